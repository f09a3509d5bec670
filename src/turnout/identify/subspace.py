"""Signal subspace of several decays: from it the state matrices of all orders at once."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from turnout.identify.hankel import gram_matrices

MOST_ROWS = 300


@dataclass(frozen=True)
class Subspace:
    """Leading left singular vectors ``u`` (n_row, order) of the Hankel matrices side by side.

    ``index`` (n_row,) are the samples that the rows begin at; ``step`` (order, order) is the state matrix of the
    largest order, of which those of lower orders are leading blocks but for the correction by ``last``.
    """

    u: np.ndarray
    index: np.ndarray
    step: np.ndarray
    last: np.ndarray | None

    def state_matrix(self, order: int) -> np.ndarray:
        """(order, order) one-sample state matrix."""
        block = self.step[:order, :order]
        if self.last is None:
            return block
        tip = self.last[:order]
        return block + np.outer(tip, tip @ block) / max(1.0 - tip @ tip, 1e-12)


def subspaces(decays, rows: int, order: int, starts=(0,)) -> list[Subspace]:
    r"""One subspace for each start sample.

    Up to ``MOST_ROWS`` rows the state matrix is the least squares solution of :math:`U_\uparrow A = U_\downarrow`.
    A longer record keeps its length but only every q-th row, and :math:`A = S^{-1} U^T H_1 V S^{-1}` still steps by
    one sample: nothing is decimated and nothing folds.
    """
    stride = -(-rows // MOST_ROWS)
    if stride == 1:
        return [_shifted(gram, order) for gram in gram_matrices(decays, rows, starts)]
    return [_strided(decays, rows, order, start, stride) for start in starts]


def _leading(gram, order):
    n = len(gram)
    w, u = eigh(gram, subset_by_index=(n - order, n - 1))
    return w[::-1], u[:, ::-1]


def _shifted(gram, order):
    _, u = _leading(gram[:-1, :-1], order)
    return Subspace(u, np.arange(len(u)), u[:-1].T @ u[1:], u[-1])


def _strided(decays, rows, order, start, stride):
    index = np.arange(0, rows, stride)
    columns = decays.shape[1] - rows
    products = np.zeros((2, len(index), len(index)))
    for y in decays:
        windows = np.lib.stride_tricks.sliding_window_view(y[start:], columns - start)
        here, next_sample = windows[index], windows[index + 1]
        products += here @ here.T, next_sample @ here.T
    w, u = _leading(products[0], order)
    return Subspace(u, index, (u.T @ products[1] @ u) / np.maximum(w, np.finfo(float).tiny), None)
