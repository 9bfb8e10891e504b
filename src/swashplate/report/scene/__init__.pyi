from .scene import write_scene as write_scene
from .verdict import write_judgment as write_judgment
