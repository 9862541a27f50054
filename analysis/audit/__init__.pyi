from .printed import Printed
from .rows import READINGS, Audit, PrintedRow, ReadingVerdict, RowAudit, audit

__all__ = ["READINGS", "Audit", "Printed", "PrintedRow", "ReadingVerdict", "RowAudit", "audit"]
