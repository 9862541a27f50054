"""The spectrum of a displacement along a line above the real axis, by adaptive panels.

What is wanted at the bins of a fine uniform grid is solved at a few Chebyshev nodes of panels that
are as wide as the field is smooth. Every round solves all pending panels at once; a panel whose
series has not converged is halved, one without drive energy is left out, and the range grows until
what lies above it no longer counts.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field import solve

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.drive import Drive
    from stimuli.jobs import Job
    from stimuli.scene import Scene

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]
