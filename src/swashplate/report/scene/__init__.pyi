from .pages import write_scene as write_scene
from .verdicts import write_assessment as write_assessment
from .verdicts import write_operability as write_operability
