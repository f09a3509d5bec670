"""Explicit leapfrog time integration of rail, supports, attached masses, wheels and hammer; compiled.

Forces and moments of the rail are taken at whole time steps, velocities at half steps (Yee 1966, for a Timoshenko
beam). Every support, contact and body is explicit. At 1/60000 s the stiffest, a wheel on 12 kg of rail, advances by
0.2 rad a step. Damping forces use the velocity half a step earlier.

All compiled parts are in this file: numba compiles ``march`` again only if the file that contains it has changed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, TypeVar, cast

import numba
import numpy as np
from numba.extending import overload

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from turnout_blind.march_inputs import AttachedMasses, Beam, Blade, Cars, Hammer, Supports, WheelMotion, Wheels

TIME_STEP = 1.0 / 60000.0
Function = TypeVar("Function", bound=Callable)


def compile_part(fastmath: bool = False, for_python: bool = False) -> Callable[[Function], Function]:
    """Decorator: compile a part of ``march`` with numba, and store its machine code beside the source.

    It counts no references to its arrays, all of which ``march`` holds: each would cost two atomic operations.

    Parameters
    ----------
    fastmath : bool
        Whether sums may be reordered.
    for_python : bool
        Whether Python calls it, too. The entry takes longer to compile than the function.

    Returns
    -------
    callable
        The decorator.
    """
    options: dict[str, Any] = {"_nrt": False, "no_cpython_wrapper": not for_python, "no_cfunc_wrapper": True}
    return cast("Callable[[Function], Function]", partial(_compile, fastmath=fastmath, **options))


def _compile(function: Callable, **options: Any) -> Any:
    """The compiled function; without a folder that can be written, every process compiles it again."""
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # "no locator available": neither beside the source nor in the home folder
        return numba.njit(**options)(function)


def _value_at(value: Any, i: int) -> Any:
    """``value`` at the ``i``-th node. For a uniform rail ``value`` is a constant."""
    return value[i] if isinstance(value, np.ndarray) else value


@overload(_value_at)
def _compile_value_at(value: Any, i: int) -> Callable:
    # numba compares these signatures with that above, types included
    def at_node(value: Any, i: int) -> Any:
        return value[i]

    def at_every_node(value: Any, i: int) -> Any:
        return value

    return at_node if isinstance(value, numba.types.Array) else at_every_node


@compile_part(fastmath=True)
def _rail_step(
    beam: Beam,
    dt: float,
    v: np.ndarray,
    turn: np.ndarray,
    q: np.ndarray,
    moment: np.ndarray,
    w: np.ndarray,
    f: np.ndarray,
) -> None:
    n = v.size
    h = beam.step
    for i in range(1, n - 1):
        d = 0.5 * dt * beam.rate[i]
        push = (q[i] - q[i - 1] + f[i]) / h
        v[i] = (v[i] * (1.0 - d) + dt / _value_at(beam.mass, i) * push) / (1.0 + d)
    for i in range(n - 1):
        d = 0.5 * dt * beam.rate_between[i]
        push = (moment[i + 1] - moment[i]) / h + q[i]
        turn[i] = (turn[i] * (1.0 - d) + dt / _value_at(beam.rotary, i) * push) / (1.0 + d)
    for i in range(n - 1):
        q[i] += dt * _value_at(beam.shear, i) * ((v[i + 1] - v[i]) / h - turn[i])
    for i in range(1, n - 1):
        moment[i] += dt * _value_at(beam.bending, i) / h * (turn[i] - turn[i - 1])
        w[i] += dt * v[i]


@compile_part()
def _interpolate(x: np.ndarray, first: int, weights: np.ndarray) -> float:
    return x[first] * weights[0] + x[first + 1] * weights[1] + x[first + 2] * weights[2] + x[first + 3] * weights[3]


@compile_part()
def _add_force(f: np.ndarray, first: int, weights: np.ndarray, force: float) -> None:
    for k in range(4):
        f[first + k] += weights[k] * force


@compile_part(for_python=True)
def _ballast_force(s: Supports, j: int, y: float, rate: float, t: float) -> float:
    k = s.ballast[j] * (1.0 + s.drift[j] * t)
    if s.gap[j] < 0.0:
        return k * y * (1.0 + s.hardening[j] * abs(y)) + s.ballast_damping[j] * rate
    seated_force = s.seated[j] * (k * y + s.ballast_damping[j] * rate)
    d = y - s.gap[j]
    if d <= 0.0:
        return seated_force
    closure = 1.0 - np.exp(-d / s.close[j])
    return seated_force + (1.0 - s.seated[j]) * max(
        0.0, k * (d - s.close[j] * closure) + s.ballast_damping[j] * rate * closure
    )


@compile_part()
def _support_step(
    s: Supports,
    dt: float,
    t: float,
    w: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    y: np.ndarray,
    rate: np.ndarray,
    branch: np.ndarray,
    last: np.ndarray,
    decay: np.ndarray,
    grow: np.ndarray,
    force: np.ndarray,
) -> None:
    n, nb = y.size, decay.size
    force[:] = 0.0
    for j in range(n):
        r = _interpolate(w, s.first[j], s.weights[j]) - y[j]
        pad = s.pad[j] * (r if r >= 0.0 else r * s.lift[j])
        pad += s.pad_damping[j] * (_interpolate(v, s.first[j], s.weights[j]) - rate[j])
        for b in range(nb):
            branch[b, j] = branch[b, j] * decay[b] + s.branch_share[b] * s.pad[j] * (r - last[j]) * grow[b]
            pad += branch[b, j]
        last[j] = r
        _add_force(f, s.first[j], s.weights[j], -pad)
        force[j] += pad - _ballast_force(s, j, y[j], rate[j], t)
        if j + 1 < n:
            link = s.shear[j] * (y[j + 1] - y[j]) + s.shear_damping[j] * (rate[j + 1] - rate[j])
            force[j] += link
            force[j + 1] -= link
    for j in range(n):
        rate[j] += dt * force[j] / s.mass[j]
        y[j] += dt * rate[j]


@compile_part()
def _attached_mass_step(
    r: AttachedMasses, dt: float, w: np.ndarray, v: np.ndarray, f: np.ndarray, y: np.ndarray, rate: np.ndarray
) -> None:
    for j in range(y.size):
        d = _interpolate(w, r.first[j], r.weights[j]) - y[j]
        force = r.stiffness[j] * d + r.damping[j] * (_interpolate(v, r.first[j], r.weights[j]) - rate[j])
        if d > r.play[j]:
            force += r.stop[j] * (d - r.play[j])
        elif d < -r.play[j]:
            force += r.stop[j] * (d + r.play[j])
        _add_force(f, r.first[j], r.weights[j], -force)
        rate[j] += dt * force / r.mass[j]
        y[j] += dt * rate[j]


@compile_part()
def _fill_stencil(stencil: np.ndarray, coordinate: float) -> int:
    """Weights of a cubic B-spline at a position between nodes; returns the node below it, the second of the four."""
    k = int(np.floor(coordinate))
    s = coordinate - k
    stencil[0] = (1.0 - s) ** 3 / 6.0
    stencil[1] = (3.0 * s**3 - 6.0 * s**2 + 4.0) / 6.0
    stencil[2] = (-3.0 * s**3 + 3.0 * s**2 + 3.0 * s + 1.0) / 6.0
    stencil[3] = s**3 / 6.0
    return k


@compile_part()
def _path_height(wheels: Wheels, path: np.ndarray, i: int, x: float) -> float:
    coordinate = (x - wheels.path_start) / wheels.path_step
    k = int(np.floor(coordinate))
    if k < 1 or k > path.shape[1] - 3:
        return 0.0
    s = coordinate - k
    a, b, c, d = path[i, k - 1], path[i, k], path[i, k + 1], path[i, k + 2]
    return b + 0.5 * s * (c - a + s * (2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)))


@compile_part(for_python=True)
def hertz_force(stiffness: float, local: float, approach: float, guess: float) -> float:
    """Contact force F = k max(0, approach - local F)^1.5 by Newton's method.

    Parameters
    ----------
    stiffness : float
        Hertz constant k. [N/m^1.5]
    local : float
        Compliance of the rail. [m/N]
    approach : float
        Approach of the bodies. [m]
    guess : float
        First guess of the force. [N]

    Returns
    -------
    float
        Force, 0 if the bodies are apart. [N]
    """
    if approach <= 0.0:
        return 0.0
    force = guess
    for _ in range(30):
        d = approach - local * force
        if d <= 0.0:
            force = 0.5 * approach / local
            continue
        root = np.sqrt(d)
        change = (force - stiffness * d * root) / (1.0 + 1.5 * stiffness * root * local)
        force -= change
        if abs(change) < 1e-4:
            break
    return force


@compile_part()
def _contact_share(motion: WheelMotion, x: float) -> float:
    if x <= motion.engage_start or x >= motion.release_end:
        return 0.0
    s = 1.0
    if x < motion.engage_end:
        s = (x - motion.engage_start) / (motion.engage_end - motion.engage_start)
    elif x > motion.release_start:
        s = (motion.release_end - x) / (motion.release_end - motion.release_start)
    return s * s * (3.0 - 2.0 * s)


@compile_part()
def _wheel_forces(
    wheels: Wheels,
    motion: WheelMotion,
    grid_start: float,
    h: float,
    t: float,
    w: np.ndarray,
    f: np.ndarray,
    z: np.ndarray,
    contact: np.ndarray,
    stencil: np.ndarray,
) -> None:
    for i in range(z.size):
        x = motion.start + motion.speed * t - wheels.distance_behind[i]
        share = _contact_share(motion, x)
        static_approach = (wheels.load[i] / wheels.stiffness[i]) ** (2.0 / 3.0) + wheels.local * wheels.load[i]
        if share == 0.0:
            contact[i] = hertz_force(wheels.stiffness[i], wheels.local, z[i] + static_approach, contact[i])
            continue
        k = _fill_stencil(stencil, (x - grid_start) / h)
        height = _interpolate(w, k - 1, stencil) + _path_height(wheels, wheels.path, i, x)
        contact[i] = hertz_force(wheels.stiffness[i], wheels.local, z[i] - share * height + static_approach, contact[i])
        _add_force(f, k - 1, stencil, share * contact[i])


@compile_part(fastmath=True)
def _blade_step(
    blade: Blade,
    h: float,
    dt: float,
    v: np.ndarray,
    turn: np.ndarray,
    q: np.ndarray,
    moment: np.ndarray,
    w: np.ndarray,
    f: np.ndarray,
) -> None:
    """As ``_rail_step``, but the first node is free: no moment, and half a cell of mass under the first shear force."""
    n = v.size
    d = 0.5 * dt * blade.rate[0]
    v[0] = (v[0] * (1.0 - d) + 2.0 * dt / (blade.mass[0] * h) * (q[0] + f[0])) / (1.0 + d)
    for i in range(1, n - 1):
        d = 0.5 * dt * blade.rate[i]
        v[i] = (v[i] * (1.0 - d) + dt / (blade.mass[i] * h) * (q[i] - q[i - 1] + f[i])) / (1.0 + d)
    for i in range(n - 1):
        d = 0.5 * dt * blade.rate_between[i]
        push = (moment[i + 1] - moment[i]) / h + q[i]
        turn[i] = (turn[i] * (1.0 - d) + dt / blade.rotary[i] * push) / (1.0 + d)
    for i in range(n - 1):
        q[i] += dt * blade.shear[i] * ((v[i + 1] - v[i]) / h - turn[i])
    for i in range(1, n - 1):
        moment[i] += dt * blade.bending[i] / h * (turn[i] - turn[i - 1])
    for i in range(n - 1):
        w[i] += dt * v[i]


@compile_part()
def _chair_forces(
    blade: Blade,
    s: Supports,
    dt: float,
    w: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    y: np.ndarray,
    rate: np.ndarray,
) -> None:
    """Forces of the chairs on blade and bearers; that on a bearer changes its velocity at once."""
    for c in range(blade.support.size):
        j, k = blade.support[c], blade.stiffness[c]
        d = _interpolate(w, blade.first[c], blade.weights[c]) - y[j]
        force = k * d + blade.damping[c] * (_interpolate(v, blade.first[c], blade.weights[c]) - rate[j])
        if blade.gap[c] >= 0.0:
            at_rest = max(0.0, blade.load[c] - k * blade.gap[c])
            pressed = force - k * blade.gap[c] + blade.load[c]
            force = max(0.0, pressed) - at_rest
        _add_force(f, blade.first[c], blade.weights[c], -force)
        rate[j] += dt * force / s.mass[j]


@compile_part()
def _wheel_forces_of_two_rails(
    wheels: Wheels,
    motion: WheelMotion,
    blade: Blade,
    grid_start: float,
    h: float,
    t: float,
    w: np.ndarray,
    f: np.ndarray,
    w2: np.ndarray,
    f2: np.ndarray,
    z: np.ndarray,
    contact: np.ndarray,
    contact2: np.ndarray,
    stencil: np.ndarray,
) -> None:
    """As ``_wheel_forces``, on the stock rail before the change, on the blade after it, on both between.

    ``contact2`` (2, n_wheel) are the forces on stock rail and blade, ``contact`` their sum.
    """
    for i in range(z.size):
        x = motion.start + motion.speed * t - wheels.distance_behind[i]
        share = _contact_share(motion, x)
        approach = z[i] + (wheels.load[i] / wheels.stiffness[i]) ** (2.0 / 3.0) + wheels.local * wheels.load[i]
        if share == 0.0:
            contact[i] = hertz_force(wheels.stiffness[i], wheels.local, approach, contact[i])
            continue
        k = _fill_stencil(stencil, (x - grid_start) / h)
        contact[i] = 0.0
        for line in range(2):
            on_line = x < blade.change_end if line == 0 else x > blade.change_start + 4.0 * h
            if not on_line:
                contact2[line, i] = 0.0
                continue
            path = wheels.path if line == 0 else wheels.blade_path
            node = k - 1 if line == 0 else k - 1 - blade.start
            deflection = _interpolate(w if line == 0 else w2, node, stencil)
            height = share * (deflection + _path_height(wheels, path, i, x))
            guess = contact2[line, i] if contact2[line, i] > 0.0 else 1000.0
            force = hertz_force(wheels.stiffness[i], wheels.local, approach - height, guess)
            contact2[line, i] = force
            contact[i] += force
            _add_force(f if line == 0 else f2, node, stencil, share * force)


@compile_part()
def _car_step(
    cars: Cars,
    wheels: Wheels,
    dt: float,
    z: np.ndarray,
    zv: np.ndarray,
    b: np.ndarray,
    bv: np.ndarray,
    contact: np.ndarray,
) -> None:
    """Advance the cars. ``b`` holds per car: bounce and pitch of the body, and bounce and pitch of two bogies."""
    for c in range(cars.body.size):
        o = 6 * c
        body = pitch = 0.0
        for g in range(2):
            lever = cars.half_pivot[c] if g == 0 else -cars.half_pivot[c]
            p = o + 2 + 2 * g
            link = cars.secondary[c] * (b[o] + lever * b[o + 1] - b[p])
            link += cars.secondary_damping[c] * (bv[o] + lever * bv[o + 1] - bv[p])
            body -= link
            pitch -= lever * link
            bounce, turn = link, 0.0
            for a in range(2):
                arm = cars.half_base[c] if a == 0 else -cars.half_base[c]
                i = 4 * c + 2 * g + a
                spring = cars.primary[c] * (b[p] + arm * b[p + 1] - z[i])
                spring += cars.primary_damping[c] * (bv[p] + arm * bv[p + 1] - zv[i])
                bounce -= spring
                turn -= arm * spring
                zv[i] += dt * (spring + wheels.load[i] - contact[i]) / wheels.mass[i]
            bv[p] += dt * bounce / cars.bogie[c]
            bv[p + 1] += dt * turn / cars.bogie_inertia[c]
        bv[o] += dt * body / cars.body[c]
        bv[o + 1] += dt * pitch / cars.body_inertia[c]
    for i in range(z.size):
        z[i] += dt * zv[i]
    for i in range(b.size):
        b[i] += dt * bv[i]


@_compile
def march(
    n_step: int,
    dt: float,
    grid_start: float,
    beam: Beam,
    supports: Supports,
    attached_masses: AttachedMasses,
    cars: Cars,
    wheels: Wheels,
    motion: WheelMotion,
    hammer: Hammer,
    first: np.ndarray,
    weights: np.ndarray,
    every: int,
    blade: Blade,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """March ``n_step`` steps.

    Velocities are those half a step after each whole step. The state is deflection w [m], its
    velocity v [m/s], rotational velocity turn [rad/s], shear force q [N] and moment [N m] of the rail, displacement [m]
    and velocity [m/s] of the sleepers.

    Parameters
    ----------
    n_step : int
        Number of time steps.
    dt : float
        Time step. [s]
    grid_start : float
        Position of the first node. [m]
    beam : Beam
        The rail.
    supports : Supports
        Pads, sleepers and ballast.
    attached_masses : AttachedMasses
        Masses attached to the rail.
    cars : Cars
        Bodies and bogies.
    wheels : Wheels
        Wheels and their paths.
    motion : WheelMotion
        Position and speed of the train.
    hammer : Hammer
        Hammer; mass 0: none.
    first : (n_sensor,) array of int
        First node of each sensor.
    weights : (n_sensor, 4) array of float
        Weights of its four nodes.
    every : int
        Steps between two stored wheel forces.
    blade : Blade
        A second rail; without nodes: none.

    Returns
    -------
    velocity : (n_step, n_sensor) array of float
        Of the rail at the sensors. [m/s]
    hammer_force : (n_step,) array of float
        [N]
    wheel_force : (n_step // every + 1, n_wheel) array of float
        [N]
    state : tuple of arrays
        The last state: (n_node,) w, v and moment, (n_node - 1,) turn and q, (n_support,) of the sleepers.
    """
    n = beam.rate.size
    w, v, q, moment, f = np.zeros(n), np.zeros(n), np.zeros(n - 1), np.zeros(n), np.zeros(n)
    turn = np.zeros(n - 1)
    y, rate = np.zeros(supports.mass.size), np.zeros(supports.mass.size)
    decay = np.exp(-supports.branch_rate * dt)
    grow = (1.0 - decay) / (supports.branch_rate * dt)
    branch, last, force = np.zeros((decay.size, y.size)), np.zeros(y.size), np.zeros(y.size)
    ry, rrate = np.zeros(attached_masses.mass.size), np.zeros(attached_masses.mass.size)
    z, zv, contact = np.zeros(wheels.mass.size), np.zeros(wheels.mass.size), wheels.load.copy()
    b, bv = np.zeros(6 * cars.body.size), np.zeros(6 * cars.body.size)
    nb = blade.mass.size
    w2, v2, q2, moment2, f2 = np.zeros(nb), np.zeros(nb), np.zeros(max(nb - 1, 0)), np.zeros(nb), np.zeros(nb)
    turn2, contact2 = np.zeros(max(nb - 1, 0)), np.zeros((2, z.size))
    stencil, n_impacts, head_position, head_speed = np.zeros(4), 0, 0.0, 0.0
    out, hammer_force = np.zeros((n_step, first.size)), np.zeros(n_step)
    wheel_forces = np.zeros((n_step // every + 1, z.size))
    for step in range(n_step):
        t = step * dt
        f[:] = 0.0
        if nb:
            f2[:] = 0.0
            _chair_forces(blade, supports, dt, w2, v2, f2, y, rate)
        _support_step(supports, dt, t, w, v, f, y, rate, branch, last, decay, grow, force)
        _attached_mass_step(attached_masses, dt, w, v, f, ry, rrate)
        if z.size:
            if nb:
                _wheel_forces_of_two_rails(
                    wheels, motion, blade, grid_start, beam.step, t, w, f, w2, f2, z, contact, contact2, stencil
                )
            else:
                _wheel_forces(wheels, motion, grid_start, beam.step, t, w, f, z, contact, stencil)
            _car_step(cars, wheels, dt, z, zv, b, bv, contact)
            if step % every == 0:
                wheel_forces[step // every] = contact
        if hammer.mass > 0.0:
            if n_impacts < hammer.times.size and t >= hammer.times[n_impacts]:
                head_position, head_speed = _interpolate(w, hammer.first, hammer.weights), hammer.velocities[n_impacts]
                n_impacts += 1
            d = head_position - _interpolate(w, hammer.first, hammer.weights)
            if d > 0.0:
                closing = head_speed - _interpolate(v, hammer.first, hammer.weights)
                hammer_force[step] = max(0.0, hammer.tip * d**1.5 * (1.0 + hammer.loss * closing))
                _add_force(f, hammer.first, hammer.weights, hammer_force[step])
            head_speed -= dt * hammer_force[step] / hammer.mass
            head_position += dt * head_speed
        _rail_step(beam, dt, v, turn, q, moment, w, f)
        if nb:
            _blade_step(blade, beam.step, dt, v2, turn2, q2, moment2, w2, f2)
        for k in range(first.size):
            out[step, k] = _interpolate(v, first[k], weights[k])
    return out, hammer_force, wheel_forces, (w, v, turn, q, moment, y, rate)
