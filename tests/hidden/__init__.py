"""Cases in which an effect is hidden: an independent generator for testing and benchmarking `explain`.

It follows every detector on its own and has its own functional forms for every effect. It shares no code with the
package under test and never imports it.
"""

from .cases import fresh_frames, write_case
from .orders import CaseOrder, plan
from .sealing import Sealed, Truth

__all__ = ["CaseOrder", "Sealed", "Truth", "fresh_frames", "plan", "write_case"]
