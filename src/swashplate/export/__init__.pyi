from .c_folder import c as c
from .c_folder import drive_sources as drive_sources
from .c_folder import exported_drive as exported_drive
from .c_folder import exported_model as exported_model
from .c_folder import feedthrough as feedthrough
from .c_folder import model_values as model_values
from .c_folder import values_of as values_of
