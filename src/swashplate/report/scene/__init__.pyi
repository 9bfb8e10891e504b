from .pages import write_scene as write_scene
from .verdicts import write_judgment as write_judgment
from .verdicts import write_operability as write_operability
