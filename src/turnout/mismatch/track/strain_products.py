"""Compiled sums over the rail's elements of products of strains under two unit forces."""

import numpy as np

from turnout.simulate.compiled import kernel


@kernel
def by_rail(struck, seated, row, length, weights):
    """(n_struck, n_sensor, n_line, 2) derivatives of receptances by the logarithms of bending and shear stiffness.

    ``struck`` (n_struck, n_line, n) and ``seated`` (n_sensor, n_line, n) are displacements under unit forces, ``row``
    (n_node,) that of a node's deflection, ``length`` (n_element,), ``weights`` (3, n_element) what bending, shearing
    and shearing by the shear stiffness alone of each element weigh.
    """
    n_struck, n_line, n_sensor, n_element = struck.shape[0], struck.shape[1], seated.shape[0], length.size
    found = np.zeros((n_struck, n_sensor, n_line, 2), dtype=np.complex128)
    bent, skew = np.zeros((2, n_struck + n_sensor, n_element)), np.zeros((2, n_struck + n_sensor, n_element))
    for line in range(n_line):
        for k in range(n_struck + n_sensor):
            u = struck[k, line] if k < n_struck else seated[k - n_struck, line]
            for e in range(n_element):
                first, second = row[e], row[e + 1]
                b = u[second + 1] - u[first + 1]
                s = (u[second] - u[first]) / length[e] - 0.5 * (u[first + 1] + u[second + 1])
                bent[0, k, e], bent[1, k, e], skew[0, k, e], skew[1, k, e] = b.real, b.imag, s.real, s.imag
        for p in range(n_struck):
            for q in range(n_sensor):
                b_p, c_p, s_p, t_p = bent[0, p], bent[1, p], skew[0, p], skew[1, p]
                k = n_struck + q
                b_q, c_q, s_q, t_q = bent[0, k], bent[1, k], skew[0, k], skew[1, k]
                real, imag, shear_real, shear_imag = 0.0, 0.0, 0.0, 0.0
                for e in range(n_element):
                    x, y = s_p[e] * s_q[e] - t_p[e] * t_q[e], s_p[e] * t_q[e] + t_p[e] * s_q[e]
                    bend, shear, alone = weights[0, e], weights[1, e], weights[2, e]
                    real += bend * (b_p[e] * b_q[e] - c_p[e] * c_q[e]) + shear * x
                    imag += bend * (b_p[e] * c_q[e] + c_p[e] * b_q[e]) + shear * y
                    shear_real += alone * x
                    shear_imag += alone * y
                found[p, q, line, 0] = -complex(real, imag)
                found[p, q, line, 1] = -complex(shear_real, shear_imag)
    return found
