"""What a run counts, and one look at it."""

from dataclasses import dataclass

from .state import RunState


@dataclass(slots=True)
class Counts:
    """Numbers of drives and ticks since the start of the run."""

    drives_lost: int = 0
    """lockstep: measurements sent again, because no drive had come; realtime: ticks that ran on a held drive."""
    horizon_ticks: int = 0
    """realtime: ticks without a new drive that ran on a drive of the horizon of the last one."""
    drives_refused: int = 0
    """Drives with a value that is NaN or infinite."""
    drives_outdated: int = 0
    """Drives for a measurement older than the one answered last, or for that one again. None is put in force."""
    drives_ahead: int = 0
    """Drives for a measurement that has not been published. None is put in force."""
    drives_malformed: int = 0
    """Drives that could not be read, or with a stamp that is no time of a run. None is put in force."""
    drives_clipped: int = 0
    """Updates of the drive at which it was beyond the range of the piezo, and clipped."""
    drives_steep: int = 0
    """Updates of the drive at which it was held back by the slew limit."""
    late_ticks: int = 0
    """realtime: ticks that began later than a period after their deadline."""
    periods_missed: int = 0
    """realtime: periods left out because of it."""
    ticks_retracted: int = 0
    """realtime: ticks in which the sample was retracted."""
    scored_ticks_retracted: int = 0
    """Those of them that are scored."""
    withdrawals: int = 0
    """Times that the sample was withdrawn because of a limit."""
    ticks_withdrawn: int = 0
    """Ticks in which the instrument had the drive because of a limit: withdrawn, or on the way back to the tip."""
    scored_ticks_withdrawn: int = 0
    """Those of them that are scored."""


@dataclass(frozen=True)
class Snapshot:
    """A run as it is now. Taking one costs some microseconds."""

    state: RunState
    detail: str
    ticks: int
    time: float  # simulated time of the next tick [s]
    stamp_ns: int  # the same [ns]
    samples: int  # per detector channel
    elapsed: float  # wall time of the run, pauses left out [s]
    wanted_factor: float | None  # realtime: simulated over wall time as asked for; None in lockstep
    in_contact: bool
    counts: Counts
    refusal: str  # the sentence about the drive refused last; empty if none was
    faults: tuple[str, ...] = ()  # names of the faults that act now
    faults_acted: tuple[str, ...] = ()  # and of those that have acted
    reason: str = ""  # why the controller's drive is not in force, in two words; empty if it is
    samples_saturated: int = 0  # at which the detector was beyond its range
    time_outside: float = 0.0  # in which the plant did not hold [s]
    scored_ticks_held: int = 0  # realtime: scored ticks without a new drive, those on a horizon left out
    unreadable: str = ""  # a clause about the drive that could not be read last; empty if there was none
    run_id: int = 0  # name of the run

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time up to now; 0 before the start."""
        return self.time / self.elapsed if self.elapsed > 0.0 else 0.0
