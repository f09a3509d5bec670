"""Open world: each effect is taken out of the library, and sites of the blind generator with it are diagnosed.

The answer must be "unknown" at its position, or a declared relative there (``left_out_library``). Another name is
wrong. There are two questions. "change": the calibrated model says what has changed, after two visits. "visit": the
recordings of one visit are compared with the owner's file. Sites are those of the generator of the blind proof, with an
effect from the upper half of its ladder, which must be clear.

TURNOUT_LEFT_OUT_QUESTIONS chooses questions ("change,visit"), TURNOUT_LEFT_OUT_EFFECTS effects of the library (all).
TURNOUT_LEFT_OUT_SITES sets the sites of each effect (2), TURNOUT_LEFT_OUT_FIRST the number of the first one (0).
TURNOUT_LEFT_OUT_PRESENT=1 diagnoses each site with the whole library too. TURNOUT_LEFT_OUT_STORE is a folder of
answers: those in it are not computed again, whichever version of the tool gave them. TURNOUT_LEFT_OUT_PAGE is a page
whose blocks "leave_one_out" and "leave_one_out_visit" are replaced by the results, such as docs/left_out_effects.md.
"""

import json
import os
import re
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from benchmarks.blind_bridge import campaigns_of, rows_of
from benchmarks.left_out_library import OWN_NAMES, kinds_of_effects, library
from turnout.mismatch.calibrated.model_answer import NAMES
from turnout.mismatch.calibrated.soft_ballast_or_gap import GAP
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.turnout.case import TrackCase
from turnout.stages.calibrated_model import answer_rows, calibrate_turnout
from turnout_blind.campaign import make_case, stage
from turnout_blind.history import START, STEP, HistoryPlan, make_history
from turnout_blind.score.answers import answers_of
from turnout_blind.score.histories import QUESTION
from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.matching import MAX_POSITION_ERROR, MIN_CLEAR_GAIN, gain_of, judge
from turnout_blind.score.names import right_names
from turnout_blind.strata import CasePlan
from turnout_blind.visibility import effect_visibility

SEED, N_VISITS = 20261125, 2
OUTCOMES = {
    "unknown": "at its position", "right": "a relative, at its position", "elsewhere": "at another position",
    "none": "not seen", "other": "another name",
}  # fmt: skip


@dataclass(frozen=True)
class Site:
    """Site ``k`` of the ``effect`` that is left out, with that ``kind`` of the generator in a ``panel``."""

    effect: str
    kind: str
    k: int
    panel: str

    def rungs(self):
        """Rungs of the ladder of the kind: the highest one, the next site one less, and from there on upwards."""
        n = len(kinds_of_effects()[self.kind].ladder)
        return range(n - 1 - self.k % max(1, n // 2), n)


@dataclass(frozen=True)
class Answer:
    """Outcome of ``OUTCOMES`` and words of an answer, its CPU time [s], and the gain that the effect costs [points]."""

    outcome: str
    words: str
    cpu: float = 0.0
    gain: float = 0.0


def bars():
    """Yield the bars of each question."""
    for question in os.environ.get("TURNOUT_LEFT_OUT_QUESTIONS", "change,visit").split(","):
        yield from _bars_of(question)


def _bars_of(question):
    with_present = os.environ.get("TURNOUT_LEFT_OUT_PRESENT") == "1"
    present, missing = [], []
    for site in sites(question):
        answer = _stored(question, site, without=True)
        if answer is None:
            continue
        missing.append((site, answer))
        print(f"{question}, {site.kind} without {site.effect}: {answer.words} ({OUTCOMES[answer.outcome]})", flush=True)
        if with_present:
            present.append((site, _stored(question, site, without=False)))
    cpu = sum(a.cpu for _, a in present + missing)
    n, title = len(missing), f"{question}: effect left out, "
    if not n:
        return
    yield _bar(title + "another name", missing, ("other",), 3.0, "<=")
    yield _bar(title + "located", missing, ("unknown", "right"), 80.0, ">=")
    yield _bar(title + "called intact", missing, ("none",), None, "<=")
    if present:
        yield _bar(f"{question}: effect in the library, its name at its position", present, ("right",), None, "")
    yield Bar(f"{question}: CPU time of all sites", cpu, None, "s")
    if page := os.environ.get("TURNOUT_LEFT_OUT_PAGE"):
        block = {"change": "leave_one_out", "visit": "leave_one_out_visit"}[question]
        replace_block(Path(page), block, table(missing, present, cpu))


def sites(question):
    """Sites of a question: of every effect that it can name and that the generator can conceal.

    Names are withheld at switch panels: effects of a blade cannot be named wrongly, and have no site.
    """
    n, first = (int(os.environ.get(f"TURNOUT_LEFT_OUT_{w}", d)) for w, d in (("SITES", "2"), ("FIRST", "0")))
    chosen = os.environ.get("TURNOUT_LEFT_OUT_EFFECTS")
    changes = {*NAMES.values(), GAP}
    for name, effect in library().items():
        kinds = [kind for kind in effect.kinds if kinds_of_effects()[kind].stratum != "switch"]
        if not kinds or (question == "change" and name not in changes) or (chosen and name not in chosen.split(",")):
            continue
        for k in range(first, first + n):
            kind = kinds[k % len(kinds)]
            yield Site(name, kind, k, kinds_of_effects()[kind].site.get("panel", ("plain", "crossing")[k % 2]))


def replace_block(page, block, text):
    """Replace what stands in ``page`` between the two comments of a block."""
    begin, end = f"<!-- begin {block} -->", f"<!-- end {block} -->"
    old = page.read_text()
    if begin not in old or end not in old:
        raise ValueError(f"{page}: no block between {begin} and {end}")
    page.write_text(re.sub(f"{begin}.*{end}", lambda _: f"{begin}\n{text}\n{end}", old, flags=re.DOTALL))


def table(missing, present, cpu):
    """Sites by effect as a table: the answer without the effect in the library and, where asked, with it."""
    with_it = {site: answer.words for site, answer in present}
    head = ["concealed, cost of the effect", "left out", *(["answer with it"] if present else []), "answer without it"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for site, answer in missing:
        cells = [f"{site.kind} ({site.panel}), {answer.gain:.0f} points", f"`{site.effect}`"]
        cells += [with_it[site]] if present else []
        lines.append(f"| {' | '.join(cells)} | {answer.words} ({OUTCOMES[answer.outcome]}) |")
    lines += ["", _share_in_words("Another name", missing, ("other",), "bar 3 %")]
    lines += [_share_in_words("Located", missing, ("unknown", "right"), "bar 80 %")]
    if present:
        seen = [(site, a) for site, a in missing if dict(present)[site].outcome != "none"]
        lines += [_share_in_words("Located, of those that are seen with it", seen, ("unknown", "right"), "bar 80 %")]
    return "\n".join([*lines, f"{cpu:.0f} CPU s for all sites."])


def _share_in_words(words, answers, outcomes, bar):
    k, n = sum(a.outcome in outcomes for _, a in answers), len(answers)
    low, high = clopper_pearson(k, n)
    return f"{words}: {k} of {n} (95 %: {100 * low:.0f} to {100 * high:.0f} %; {bar})."


def _bar(title, answers, outcomes, bar, sense):
    chosen, n = [(s, a) for s, a in answers if a.outcome in outcomes], len(answers)
    low, high = clopper_pearson(len(chosen), n)
    words = "; ".join(f"{s.kind} without {s.effect}: {a.words}" for s, a in chosen if sense == "<=")
    note = f"{100 * low:.0f} to {100 * high:.0f} %" + (f"; {words}" if words else "")
    return Bar(title, 100.0 * len(chosen) / n, bar, "%", sense, f"n = {n}", note)


def _stored(question, site, without):
    """``Answer`` at a site with or without the effect in the library, from the store if it is there.

    None if the effect is clear at none of its rungs.
    """
    folder = os.environ.get("TURNOUT_LEFT_OUT_STORE")
    name = f"{question}-{site.effect}-{site.kind}-{site.k}{'' if without else '-present'}.json"
    if folder and (Path(folder) / name).exists():
        answer = json.loads((Path(folder) / name).read_text())
    else:
        answer = _answer(question, site, without)
        answer = answer and asdict(answer)
        if folder:
            Path(folder).mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_text(json.dumps(answer) + "\n")
    return answer and Answer(**answer)


def _answer(question, site, without):
    make, answer = {"change": (make_site, answer_of_change), "visit": (make_visit, answer_of_visit)}[question]
    with stopwatch() as watch, tempfile.TemporaryDirectory() as folder:
        truth = make(Path(folder), site)
        if truth is None:
            return None
        names = library()[site.effect].relatives if without else right_names(site.kind, OWN_NAMES)
        outcome, words = answer(folder, truth, (site.effect,) if without else (), names)
    return Answer(outcome, words, watch.cpu, largest_gain(truth["visible"]))


def largest_gain(visible):
    """Gain that an effect costs in a single visit, or the largest of the visits of a site [points]."""
    return max(map(gain_of, visible if isinstance(visible, list) else [visible]))


def make_site(folder, site):
    """Truth of a site with two visits; None if the effect is clear at none of its rungs."""
    for rung in site.rungs():
        plan = HistoryPlan(
            (START, STEP)[site.k % 2], (site.kind, rung), (SEED, site.k, len(site.effect)), site.panel, N_VISITS
        )
        truth = make_history(folder, f"{site.effect}_{site.k}_{rung}", plan, kinds_of_effects())
        if largest_gain(truth["visible"]) > MIN_CLEAR_GAIN:
            return truth
    return None


def make_visit(folder, site):
    """Truth of a single visit; None if the effect is clear at none of its rungs."""
    for rung in site.rungs():
        plan = CasePlan("single", ((site.kind, rung),), (SEED, site.k, *site.effect.encode()), site.panel)
        _, staged, world, _ = stage(plan, kinds_of_effects())
        if gain_of(effect_visibility(staged, world, list(plan.seed))) > MIN_CLEAR_GAIN:
            return make_case(folder, f"{site.effect}_{site.k}", plan, kinds_of_effects())
    return None


def answer_of_visit(folder, truth, without, names):
    """(outcome, words) of the diagnosis of a single visit in a library ``without`` effects.

    It is located if all that the scorer of the blind proof asks of an effect outside the library is right: what it is
    locked to, and its position, sensor, train and axle.
    """
    families, rows = set(library()) - set(without), []
    for campaign in campaigns_of(Path(folder) / truth["case"], truth["case"]):
        rows += rows_of(diagnose(TrackCase(campaign, families=families)))
    alarms = [answer for answer in answers_of(rows) if not answer.says_none]
    words = "; ".join(map(_in_words, alarms)) or "none"
    if not alarms:
        return "none", words
    stated = {name for answer in alarms for name in answer.names}
    if stated - set(names):
        return "other", words
    if not all(judge(truth, alarms, OWN_NAMES).located.values()):
        return "elsewhere", words
    return ("right" if stated else "unknown"), words


def _in_words(answer):
    position = None if answer.position is None else f"{answer.position:.1f} m"
    axle = f"axle {answer.axle} of {answer.train}" if answer.axle else answer.train
    where = ", ".join(filter(None, (position, answer.sensor, axle))) or answer.lock or "no position"
    return f"{' or '.join(answer.names) or answer.verdict} at {where}"


def answer_of_change(folder, truth, without, names):
    """(outcome, words) of the last answer of the calibrated model to the question that asks for the effect.

    "right" with one of these names, "unknown" at the position of the effect, "elsewhere", "other" name, or "none".
    """
    case, (effect,) = Path(folder) / truth["case"], truth["effects"]
    model = calibrate_turnout(truth["case"], case / "config", case / "raw", case / "work", without=without)
    (row,) = (r for r in answer_rows(model) if r["question"] == QUESTION[truth["pattern"]])
    stated = [name for name in (row["term"], row["rival_term"]) if name]
    words = f"{' or '.join(stated) or row['verdict']} at {row['parameter'] or 'no position'}"
    if row["verdict"] == "none":
        return "none", words
    if set(stated) - set(names):
        return "other", words
    position = effect["where"].get("position", truth["sensors"].get(effect["where"].get("sensor")))
    if row["position_m"] is None or abs(row["position_m"] - position) > MAX_POSITION_ERROR:
        return "elsewhere", words
    return ("right" if stated else "unknown"), words
