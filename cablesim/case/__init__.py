"""Case files: models, YAML, units, JSON Schema and readable errors.

Depends on: nothing of ours.
"""

from cablesim.case.case import Case as Case
from cablesim.case.case import case_schema as case_schema
from cablesim.case.case import load_case as load_case
from cablesim.case.errors import CaseError as CaseError
from cablesim.case.errors import Problem as Problem
