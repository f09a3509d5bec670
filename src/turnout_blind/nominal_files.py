"""Write the files of the owner: layout, track, vehicles and table of turnouts, with nominal values and no effect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.site import RAIL_DAMPING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout_blind.crossing import Crossing
    from turnout_blind.instrument import MeasurementChain
    from turnout_blind.site import Site
    from turnout_blind.switch import Switch
    from turnout_blind.vehicle import Train

SOURCE = "the owner's register"
TOE_SECTION = 0.6  # of the blade at its toe, as a share of the rail; truth: ``switch.PLANED_SHARE``
RAIL = (("youngs_modulus", 210.0, "GPa"), ("second_moment", 3037.0, "cm⁴"), ("area", 76.7, "cm²"),
        ("mass", 60.2, "kg/m"), ("shear_modulus", 80.77, "GPa"), ("shear_coefficient", 0.393, "-"),
        ("density", 7850.0, "kg/m³"), ("damping", RAIL_DAMPING, "N s/m²"))  # fmt: skip


def write_configuration(folder: str | Path, turnout: str, site: Site) -> None:
    """Write config/ of one site below ``folder``, in the formats of the project.

    Parameters
    ----------
    folder : str or Path
        Folder of the configuration, created where it does not exist.
    turnout : str
        Id of the turnout.
    site : Site
        The site.
    """
    folder = Path(folder)
    for name in ("layouts", "tracks", "vehicles"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    settings = "mismatch: {unproven_names: true}" if site.switch else "{}"  # a proof needs the names
    (folder / "config.yaml").write_text(f"# All settings as the program has them.\n{settings}\n")
    (folder / "turnouts.tsv").write_text(f"turnout\tlayout\traw\tname\n{turnout}\tsite\t{turnout}\tSite {turnout}\n")
    (folder / "layouts" / "site.yaml").write_text(layout(site))
    (folder / "tracks" / "site.yaml").write_text(track(site))
    for name, train in site.trains.items():
        (folder / "vehicles" / f"{name}.yaml").write_text(vehicle(train))
    (folder / "vehicles" / "axle_patterns.yaml").write_text(patterns(site.trains))


def layout(site: Site) -> str:
    """Sections at the sensors, channels of hammer tests and passages.

    Parameters
    ----------
    site : Site
        The site.

    Returns
    -------
    str
        Text of the file.
    """
    lines = ["description: four sensors on the rail of one track", "sections:"]
    for i, position in enumerate(site.sensors, 1):
        lines += [f"  S{i}:", "    panel: CLP", "    track: main", f"    position: {position:.2f}", "    hammer:"]
        lines += [f"      response: A{i}", "      channels:"]
        lines += [f"        A{k}: {{offset: {x - position:.2f}}}" for k, x in enumerate(site.sensors, 1)]
    lines += ["hammer:", '  files: "hammer/{campaign}/{section}_{test}.{ext}"', "  format: npz", "  rate: 20000"]
    lines += ["  records: 6", "  samples: 5000", "  time_zone: UTC", "  force: force", "  response: A1", "  channels:"]
    lines += [
        "    force: {source: force, quantity: force, unit: N, mounting: hammer, "
        f"limit: {site.force.full_scale:g}, resolution: {site.force.step:.6g}}}"
    ]
    lines += [_channel(c, c.name, "") for c in site.chains]
    lines += ["passages:", '  files: "passages/{time}.{ext}"', "  format: npz", "  rate: 5000", "  time_zone: UTC"]
    lines += ["  channels:", *(_channel(c, c.name, f", section: S{c.name[1:]}") for c in site.chains)]
    return "\n".join(lines) + "\n"


def _channel(chain: MeasurementChain, name: str, suffix: str) -> str:
    return (
        f"    {name}: {{source: {name}, quantity: acceleration, unit: m/s², mounting: rail web, "
        f"limit: {chain.full_scale:g}, resolution: {chain.step:.6g}{suffix}}}"
    )


def _value(value: float, unit: str, prior: float | None = None) -> str:
    prior_text = "" if prior is None else f", prior: {prior}"
    return f'{{value: {value:.6g}, unit: "{unit}", source: register{prior_text}}}'


def track(site: Site) -> str:
    """Nominal rail, and supports of two zones.

    Parameters
    ----------
    site : Site
        The site.

    Returns
    -------
    str
        Text of the file.
    """
    lines = ["name: site", "layers: 2", "elements_per_bay: 4", "sources:", f'  register: "{SOURCE}"']
    lines += ["extent:", f"  from: {_value(-45.0, 'm')}", f"  to: {_value(57.0, 'm')}"]
    lines += [f"spacing: {_value(0.6, 'm', 0.03)}", "absorbing_end:"]
    lines += [f"  length: {_value(9.0, 'm')}", f"  rate: {_value(400.0, '1/s')}"]
    lines += ["rail:", "  name: 60E1", "  beam: timoshenko"]
    lines += [f"  {name}: {_value(value, unit)}" for name, value, unit in RAIL]
    lines += _casting(site.crossing) if site.crossing else []
    lines += _blade(site.switch) if site.switch else []
    lines += ["support:", *_support(site.nominal[0]), "sections:"]
    for label, zone, values in zip(("west", "east"), site.zones, site.nominal):
        lines += [f"  - label: {label}", "    panel: CLP"]
        lines += [f"    from: {_value(zone[0], 'm')}", f"    to: {_value(zone[1], 'm')}"]
        lines += ["  " + line for line in _support(values)]
    lines += ["locations:"]
    lines += [f"  S{i}: {{place: {_value(x, 'm', 0.02)}}}" for i, x in enumerate(site.sensors, 1)]
    if site.switch:
        return "\n".join([*lines, "routes:", "  main:", "    surfaces:", *_tops(site.switch)]) + "\n"
    lines += ["routes:", f"  main: [{_nose(site.crossing) if site.crossing else ''}]"]
    return "\n".join(lines) + "\n"


def _casting(crossing: Crossing) -> list[str]:
    """The crossing casting as a stretch of another rail, without the ramps at its ends."""
    factors = {"second_moment": crossing.bending, "area": crossing.mass, "mass": crossing.mass}
    start, end = crossing.ends
    lines = ["stretches:", f"  - from: {_value(start, 'm')}", f"    to: {_value(end, 'm')}", "    rail:"]
    lines += ["      name: crossing", "      beam: timoshenko"]
    return lines + [f"      {name}: {_value(value * factors.get(name, 1.0), unit)}" for name, value, unit in RAIL]


def _blade(switch: Switch) -> list[str]:
    """The blade, planed from the section of the rail, and the closure rail behind it."""
    lines = ["blade:", f"  toe: {_value(switch.toe, 'm')}", f"  heel: {_value(switch.heel, 'm')}"]
    lines += [f"  end: {_value(36.0, 'm')}", f"  chair_stiffness: {_value(switch.chair / 1e6, 'MN/m')}"]
    lines += [f"  chair_damping: {_value(switch.chair_damping / 1e3, 'kN s/m')}"]
    lines += [f"  planed: {{length: {_value(switch.length, 'm')}, share: {_value(TOE_SECTION, '-')}}}", "  rail:"]
    lines += ["    name: blade", "    beam: timoshenko"]
    return lines + [f"    {name}: {_value(value, unit)}" for name, value, unit in RAIL]


def _tops(switch: Switch) -> list[str]:
    """Both surfaces of the route, with priors as wide as the error of an estimate."""
    fall_start = _value(switch.fall_start, "m", round(0.05 / abs(switch.fall_start), 4))
    fall = f"depth: {_value(1e3 * switch.fall, 'mm', 0.12)}, length: {_value(switch.fall_length, 'm')}"
    top = f"start: {_value(switch.toe, 'm')}, depth: {_value(1e3 * switch.depth, 'mm', 0.12)}"
    length = _value(switch.length, "m", 0.06)
    return [
        f"      - [{{kind: stock_fall, start: {fall_start}, {fall}}}]",
        f"      - [{{kind: blade_top, {top}, length: {length}}}]",
    ]


def _nose(c: Crossing) -> str:
    """The nose of the crossing, with priors as wide as the error of an estimate."""
    position, share = _value(c.nose, "m", round(0.05 / c.nose, 4)), _value(c.share, "-", 0.2)
    depth, length = _value(1e3 * c.depth, "mm", 0.4), _value(c.length, "m", 0.2)
    return f"{{kind: kink, place: {position}, depth: {depth}, length: {length}, share: {share}}}"


def _support(v: Mapping[str, float]) -> list[str]:
    return [
        f"  pad_stiffness: {_value(v['pad'] / 1e6, 'MN/m', 0.3)}",
        f"  pad_damping: {_value(v['pad_damping'] / 1e3, 'kN s/m', 0.5)}",
        f"  sleeper_mass: {_value(v['mass'], 'kg', 0.05)}",
        f"  ballast_stiffness: {_value(v['ballast'] / 1e6, 'MN/m', 0.3)}",
        f"  ballast_damping: {_value(v['ballast_damping'] / 1e3, 'kN s/m', 0.5)}",
    ]


def vehicle(train: Train) -> str:
    """A vehicle file: whole cars, both rails.

    Parameters
    ----------
    train : Train
        Train as filed.

    Returns
    -------
    str
        Text of the file.
    """
    c, n = train.cars[0], len(train.cars)
    lines = [f"name: {train.name}", f"title: {train.name} of {n} cars", "sources:", f'  register: "{SOURCE}"']
    lines += [f"length: {_value(n * c.length, 'm')}", "wheel:", f"  radius: {_value(train.radius, 'm', 0.03)}"]
    lines += [f"  contact: {_value(train.contact / 1e9, 'GN/m^1.5', 0.1)}", "car_types:", "  body:"]
    lines += [
        f"    mass: {_value(c.body / 1e3, 't', 0.05)}",
        f"    inertia: {_value(c.body_inertia / 1e3, 't m²', 0.1)}",
    ]
    lines += ["bogie_types:", "  bogie:"]
    bogie: tuple[tuple[str, float, str], ...] = (
        ("mass", c.bogie, "kg"),
        ("inertia", c.bogie_inertia, "kg m²"),
        ("base", c.base, "m"),
    )
    bogie += (("wheelset_mass", c.wheelset, "kg"), ("primary_stiffness", c.primary / 1e6, "MN/m"))
    bogie += (("primary_damping", c.primary_damping / 1e3, "kN s/m"),)
    bogie += (("secondary_stiffness", c.secondary / 1e6, "MN/m"),)
    bogie += (("secondary_damping", c.secondary_damping / 1e3, "kN s/m"),)
    lines += [f"    {name}: {_value(value, unit, 0.1)}" for name, value, unit in bogie]
    lines += ["bogies:"]
    for k in range(n):
        for side, pivot in ((0, -0.5), (1, 0.5)):
            centre = k * c.length + 0.5 * c.length + pivot * c.pivots
            lines.append(f"  - {{label: b{2 * k + side + 1}, type: bogie, centre: {_value(centre, 'm')}}}")
    lines += ["cars:"]
    for k in range(n):
        middle = _value((k + 0.5) * c.length, "m")
        lines.append(f"  - {{type: body, rests_on: [b{2 * k + 1}, b{2 * k + 2}], centre: {middle}}}")
    return "\n".join(lines) + "\n"


def patterns(trains: Mapping[str, Train]) -> str:
    """Axle patterns of the trains.

    Parameters
    ----------
    trains : mapping
        Trains by name.

    Returns
    -------
    str
        Text of the file.
    """
    lines = ["vehicles:"]
    for name, train in trains.items():
        positions = ", ".join(f"{x:.3f}" for x in train.axles())
        length = sum(c.length for c in train.cars)
        lines.append(f'  {name}_unit: {{length: {length:.2f}, axles: [{positions}], source: "{SOURCE}"}}')
    lines.append("trains:")
    for name in trains:
        lines += [f"  {name}:", f"    units: [{name}_unit]"]
    return "\n".join(lines) + "\n"
