"""Published measurements of collapsing columns of water, and how a run is read to compare with them."""

import numpy as np

G = 9.81  # m/s^2

MARTIN_MOYCE_A = 0.05715
"""Base a [m], 2.25 in, of Martin & Moyce's (1952) column with n^2 = 2: it is n^2 a high."""

MARTIN_MOYCE_FRONT = np.array(
    [
        *(
            (0.41, 1.11),
            (0.84, 1.22),
            (1.19, 1.44),
            (1.43, 1.67),
            (1.63, 1.89),
            (1.83, 2.11),
            (1.98, 2.33),
            (2.20, 2.56),
        ),
        *((2.32, 2.78), (2.51, 3.00), (2.65, 3.22), (2.83, 3.44), (2.98, 3.67), (3.11, 3.89), (3.33, 4.11)),
    ]
)
"""T = t sqrt(2g/a) and Z = x/a, (15, 2)."""

MARTIN_MOYCE_HEIGHT = np.array([(0.56, 0.94), (0.93, 0.83), (1.46, 0.67), (2.00, 0.50), (2.70, 0.33), (4.20, 0.17)])
"""tau = t sqrt(g/a) and eta/(n^2 a), (6, 2)."""

KOSHIZUKA_OKA_L = 0.146
"""Base L [m] of Koshizuka & Oka's (1996) column: it is 2L high, in a tank 4L wide."""

KOSHIZUKA_OKA_FRONT = np.array(
    [(0.381, 1.111), (0.769, 1.252), (1.153, 1.505), (1.537, 1.892), (1.935, 2.241), (2.323, 2.615), (2.719, 3.003)]
)
"""t sqrt(2g/L) and x/L, (7, 2)."""


def front(x):
    """Front [m] of water that runs along x at positions `x` [m], (N, dim): the fifth-largest, one lone drop is no front."""
    return np.sort(x[:, 0])[-5]


def column_height(x, spacing):
    """Height [m] of the water at the wall x = 0: half a spacing above the third-highest particle of the first two layers."""
    return np.sort(x[x[:, 0] < 2.0 * spacing, 1])[-3] + 0.5 * spacing
