from .printed import Printed
from .rows import READINGS, Audit, PrintedRow, RowAudit, Verdict, audit

__all__ = ["READINGS", "Audit", "Printed", "PrintedRow", "RowAudit", "Verdict", "audit"]
