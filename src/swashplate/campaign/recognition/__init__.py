"""Manoeuvres recognised from nothing but the command that was logged.

`recognise` says which of the package's manoeuvres a record is (rest, step, stairs, ramp or sine),
with its numbers and windows, or that it is none of them: ``"free"``. It never guesses.
"""

from swashplate.campaign.recognition.recognise import recognise as recognise
from swashplate.campaign.recognition.recognised import Kind as Kind
from swashplate.campaign.recognition.recognised import Recognised as Recognised
from swashplate.campaign.recognition.recognised import Window as Window
