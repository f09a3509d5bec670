"""Settings of a run over the whole fleet: shards, checkpoints and limits for failed runs."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class FleetSettings:
    """Shards, checkpoints and the limits beyond which a run is called a failure."""

    shards: int = setting(
        1, why="one job per stage up to some fifty turnouts; a network of thousands wants 64", minimum=1, maximum=4096
    )
    checkpoint_units: int = setting(
        200, why="results kept after so many units, so that a kill loses minutes, not hours", minimum=1
    )
    checkpoint_time: float = setting(120.0, unit="s", why="results kept at least so often", minimum=0.0)
    vanished_share: float = setting(
        0.2, why="more known files gone than this is a lost disk, not tidying up: stop", minimum=0.0, maximum=1.0
    )
    vanished_files: int = setting(
        10, why="so few files may vanish whatever their share: a small fleet is tidied up too", minimum=0
    )
    quarantine_share: float = setting(
        0.2, why="more new recordings in quarantine than this is a fault of the installation", minimum=0.0, maximum=1.0
    )
    quarantine_units: int = setting(20, why="below so many new units a share says nothing and is not judged", minimum=1)
