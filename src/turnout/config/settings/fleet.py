"""Settings of a run over the whole fleet: shards, checkpoints and limits for failed runs."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting

MAX_SHARDS = 4096  # jobs of a stage: more need longer to start than they save


@dataclass(frozen=True)
class FleetSettings:
    """Shards, checkpoints and the limits beyond which a run is called a failure."""

    shards: int = setting(
        1,
        why="one job per stage up to some fifty turnouts; a network of thousands needs 64",
        minimum=1,
        maximum=MAX_SHARDS,
    )
    checkpoint_units: int = setting(
        200, why="results are stored after this many units, so that an interruption loses only minutes", minimum=1
    )
    checkpoint_time: float = setting(120.0, unit="s", why="longest time between two stores of results", minimum=0.0)
    vanished_share: float = setting(
        0.2, why="the run stops if a larger share of the known files is missing", minimum=0.0, maximum=1.0
    )
    vanished_files: int = setting(10, why="this number of files may vanish at any share", minimum=0)
    quarantine_share: float = setting(
        0.2, why="the run fails if a larger share of new recordings is in quarantine", minimum=0.0, maximum=1.0
    )
    quarantine_units: int = setting(20, why="with fewer new units the share is not judged", minimum=1)
