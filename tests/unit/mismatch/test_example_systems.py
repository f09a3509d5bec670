"""The example systems of other fields: a mount under a known force, and a pendulum in free decay."""

import re
import runpy
from importlib import import_module

import numpy as np
import pytest
from benchmarks import other_systems
from examples.own_system import LAWS, Mount, Pendulum, made_records, show, simulate

from turnout.mismatch import diagnose

PRIORS = 200.0, (3.8, 0.5), (0.03, 0.03)
LEVELS = {"forced": (0.3, 0.6, 1.0, 0.8), "free": (1.0, 0.5, 0.25, 0.7)}


def case_of(kind, law, amount, **options):
    force_sd = 1.0 if kind == "forced" else 0.0
    records = made_records(law, amount, LEVELS[kind], force_sd=force_sd, seconds=6.0)
    if kind == "forced":
        return Mount(records[:3], records[3:], *PRIORS, (90.0, 30.0), **options)
    return Pendulum(records[:3], records[3:], *PRIORS, **options)


# With another scale s than 1 the amount of drag is s times, that of friction one s-th of the true one.
@pytest.mark.parametrize(
    ("kind", "law", "amount", "power"), [("forced", "quadratic_drag", 0.3, 1), ("free", "dry_friction", 0.01, -1)]
)
def test_the_concealed_effect_is_named_with_its_size(kind, law, amount, power):
    case = case_of(kind, law, amount)
    found = diagnose(case)
    assert (found.verdict.answer, found.names, found.verdict.grade) == ("named", (law,), "A")
    expected = amount * case.scale**power
    error = max(3.0 * float(found.fit.psi_se[0]), 0.03 * expected)
    assert float(found.fit.psi[0]) == pytest.approx(expected, abs=error)
    assert found.verification.after > found.verification.before + 1.0


@pytest.mark.parametrize("kind", ["forced", "free"])
def test_a_system_without_a_concealed_effect_has_no_finding(kind):
    assert diagnose(case_of(kind, "", 0.0)).verdict.answer == "none"


def test_an_effect_that_is_not_in_the_library_gets_no_other_name():
    found = diagnose(case_of("free", "dry_friction", 0.03, without=("dry_friction",)))
    assert found.verdict.answer == "unknown"


def test_decays_down_to_the_noise_of_the_sensor_need_the_size_of_the_noise(capsys):
    """The tolerance is a share of the rms of a record, which falls below the noise where the body has come to rest."""
    records = made_records("dry_friction", 0.01, (1.0, 0.5, 0.1, 0.7), force_sd=0.0, noise=0.0)
    rng = np.random.default_rng(5)
    records = [(*r[:3], r[3] + 0.004 * rng.normal(size=r[3].size)) for r in records]
    without = diagnose(Pendulum(records[:3], records[3:], *PRIORS))
    assert (without.verdict.answer, without.verification.after) == ("unknown", None)
    show("free decay", without)
    assert "no law is named: check the noise" in capsys.readouterr().out
    case = Pendulum(records[:3], records[3:], *PRIORS, noise=0.004)
    named = diagnose(case)
    assert (named.verdict.answer, named.names, named.verdict.grade) == ("named", ("dry_friction",), "A")
    assert float(named.fit.psi[0]) == pytest.approx(0.01 / case.scale, rel=0.03)


def test_a_free_decay_is_that_of_the_closed_form():
    t = np.arange(2000) / 200.0
    none = np.zeros(0, dtype=np.int64), np.zeros(0)
    y = simulate(np.zeros(2000), 1.0 / 200.0, 0.7, np.array([4.0, 0.015, 0.0]), *none, 1.0)
    omega, decay = 2.0 * np.pi * 4.0, 0.015 * 2.0 * np.pi * 4.0
    damped = omega * np.sqrt(1.0 - 0.015**2)
    exact = 0.7 * np.exp(-decay * t) * (np.cos(damped * t) + decay / damped * np.sin(damped * t))
    assert np.max(np.abs(y - exact)) < 2e-4
    assert set(LAWS) >= {"quadratic_drag", "dry_friction"}


def test_both_programs_print_the_output_on_their_page(repository, capsys):
    """docs/own_simulator.md"""
    page = (repository / "docs" / "own_simulator.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```console\n\$ python (\S+(?: \S+)?)\n(.*?)^```", page, re.M | re.S)
    assert [command for command, _ in blocks] == ["-m examples.own_system", "docs/examples/bring_your_own.py"]
    for command, output in blocks:
        if command.startswith("-m "):
            import_module(command.removeprefix("-m ")).main()
        else:
            runpy.run_path(str(repository / command), run_name="__main__")
        assert capsys.readouterr().out == output


@pytest.mark.slow
def test_two_systems_of_another_program_have_the_answers_of_their_page(repository):
    """docs/own_simulator.md: the amounts differ from those of the page by less than their half widths."""

    def cells(lines):
        rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
        return [(row[0], row[1], [float(x) for x in re.findall(r"[\d.]{5,}", row[2])], float(row[3])) for row in rows]

    page = (repository / "docs" / "own_simulator.md").read_text(encoding="utf-8").splitlines()
    computed = list(other_systems.table())
    first = page.index(computed[0])
    table, found = cells(page[first + 2 : first + 6]), cells(computed[2:])
    assert [row[:2] for row in table] == [row[:2] for row in found]
    for (*_, shown_amount, shown_true), (*_, found_amount, found_true) in zip(table, found):
        assert found_true == pytest.approx(shown_true, rel=1e-3)
        assert len(shown_amount) == len(found_amount)
        if shown_amount:
            assert found_amount[0] == pytest.approx(shown_amount[0], abs=shown_amount[1])


def response_with_cubic_damping(force, amount, rate=200.0, substeps=8):
    """Displacement of the mount with a damping force of the cube of the velocity, by steps of the midpoint rule."""
    omega, y, v, out, h = 2.0 * np.pi * 4.0, 0.0, 0.0, [], 1.0 / rate / substeps

    def acceleration(y, v, f):
        return 100.0 * f - 0.03 * omega * v - omega**2 * (y + 0.1 * amount * (v / omega) ** 3)

    for n, start in enumerate(force):
        out.append(y)
        end = force[min(n + 1, force.size - 1)]
        for s in range(substeps):
            f = start + (end - start) * (s + 0.5) / substeps
            middle_v = v + 0.5 * h * acceleration(y, v, f)
            y, v = y + h * middle_v, v + h * acceleration(y + 0.5 * h * v, middle_v, f)
    return np.array(out)


def test_parts_of_the_free_laws_that_are_no_candidates_prevent_a_wrong_name():
    """Cubic damping is not in LAWS: with the laws of LAWS alone as free laws it was called quadratic drag."""
    rng, records = np.random.default_rng(7), []
    for k, level in enumerate(LEVELS["forced"]):
        force = level * np.convolve(rng.normal(size=1200), np.ones(10) / np.sqrt(10.0), "same")
        y = response_with_cubic_damping(force, 0.5)
        records.append((f"record {k}", f"level {level:g}", force, y + 0.002 * np.std(y) * rng.normal(size=y.size)))
    found = diagnose(Mount(records[:3], records[3:], *PRIORS, (90.0, 30.0)))
    assert found.verdict.answer == "unknown" and "free_law_predicts_better" in found.verdict.trail
