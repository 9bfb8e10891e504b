from .pages import write_judgment as write_judgment
from .pages import write_scene as write_scene
