"""What the numbers of an array are: real, complex, or complex with the digits of a long double."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Exact: TypeAlias = NDArray[np.clongdouble]
