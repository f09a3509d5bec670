"""Compiled sums over the rail's elements of products of strains under two unit forces."""

import numpy as np

from turnout.simulate.compiled import kernel


@kernel
def by_rail(moved, pairs, row, length, weights):
    """(n_pair, n_line, 2) derivatives of receptances by the logarithms of the rail's bending and shear stiffness.

    ``moved`` (n_place, n_line, n) are displacements under unit forces, ``pairs`` (2, n_pair) the places of blow and
    sensor, ``row`` (n_node,) that of a node's deflection, ``length`` (n_element,), ``weights`` (3, n_element) what
    bending, shearing and shearing by the shear stiffness alone of each element weigh.
    """
    n_place, n_line, n_element = moved.shape[0], moved.shape[1], length.size
    found = np.zeros((pairs.shape[1], n_line, 2), dtype=np.complex128)
    bent, skew = np.zeros((2, n_place, n_element)), np.zeros((2, n_place, n_element))
    for line in range(n_line):
        for k in range(n_place):
            u = moved[k, line]
            for e in range(n_element):
                first, second = row[e], row[e + 1]
                b = u[second + 1] - u[first + 1]
                s = (u[second] - u[first]) / length[e] - 0.5 * (u[first + 1] + u[second + 1])
                bent[0, k, e], bent[1, k, e], skew[0, k, e], skew[1, k, e] = b.real, b.imag, s.real, s.imag
        for k in range(pairs.shape[1]):
            p, q = pairs[0, k], pairs[1, k]
            b_p, c_p, s_p, t_p = bent[0, p], bent[1, p], skew[0, p], skew[1, p]
            b_q, c_q, s_q, t_q = bent[0, q], bent[1, q], skew[0, q], skew[1, q]
            real, imag, shear_real, shear_imag = 0.0, 0.0, 0.0, 0.0
            for e in range(n_element):
                x, y = s_p[e] * s_q[e] - t_p[e] * t_q[e], s_p[e] * t_q[e] + t_p[e] * s_q[e]
                bend, shear, alone = weights[0, e], weights[1, e], weights[2, e]
                real += bend * (b_p[e] * b_q[e] - c_p[e] * c_q[e]) + shear * x
                imag += bend * (b_p[e] * c_q[e] + c_p[e] * b_q[e]) + shear * y
                shear_real += alone * x
                shear_imag += alone * y
            found[k, line, 0], found[k, line, 1] = -complex(real, imag), -complex(shear_real, shear_imag)
    return found
