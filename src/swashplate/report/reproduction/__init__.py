"""The page and the PDF of what is reproduced from the source."""

from swashplate.report.reproduction.page import write_page as write_page
from swashplate.report.reproduction.printed import write_pdf as write_pdf
