"""Run the GPU's kernel in numba's simulator, as plain Python: what it finds, beside what the processor found.

    NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1 python cuda_simulated.py LIGHT.pickle ECHOES.npz

Nothing is compiled, so that no GPU is needed; the three functions that exist in compiled code alone are written out.
"""

import pickle
import struct
import sys
import warnings
from pathlib import Path

import numpy as np

from lidarcheck.model import lane_math, streams
from lidarcheck.model.detection import chain_echoes

streams._high_word = lambda a, b: np.uint64((int(a) * int(b)) >> 64)
lane_math.bits_of = lambda x: np.int64(struct.unpack("<q", struct.pack("<d", x))[0])
lane_math.from_bits = lambda bits: struct.unpack("<d", struct.pack("<q", int(bits)))[0]
warnings.simplefilter("ignore")  # whole numbers that wrap around, as they must

light, sensor, seed, frame = pickle.loads(Path(sys.argv[1]).read_bytes())
found = chain_echoes(light, sensor, seed=seed, frame=frame, device="cuda")
np.savez(sys.argv[2], **found._asdict())
