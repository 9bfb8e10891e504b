"""The five-state physical model behind the lumped parameters (Kruse 2001, chapter 6)."""
