"""The protocol as one table: codec, handlers, the list in the docs and the tests are made from it.

A row is `name | arguments | returns | how | meaning`. A name that ends with Set/Get stands for two commands: the
arguments are those of the Set, the returns those of the Get, which takes the indices of the Set (marked `@`) alone.

Types: H h I i f d numbers, S a text, SA texts, M a matrix of f, T a table of texts; `*f` a count and so many numbers,
`=f` as many as the count before said. After an argument stands what leaves a setting as it is: `/nan`, `/-1`, `/2`,
`/""`; `!`: 0 leaves it, 1 is on, 2 is off, where the Get has 1 and 0; `<`: 0 leaves it, the Get has one less.

How: `real` does or reports something of the microscope; `used` is a setting that is stored, given back and used by
other commands, `kept` one that is only stored and given back, both with what it is before (else zeros); `done` is
answered and has no effect here.
"""

import re
import shlex
from dataclasses import dataclass
from typing import Any

REAL, USED, KEPT, DONE = "real", "used", "kept", "done"
STORED = (USED, KEPT)
SETTINGS = """
Bias.Set/Get | f | f | used | bias [V]
Bias.RangeGet | | SA H | real | ranges of the bias, index
Bias.RangeSet | H | | done | index of the range
Bias.CalibrSet/Get | f f | f f | kept 1 | calibration, offset
Bias.Pulse | I f f H H | | real | wait, width [s], bias [V], hold z, relative or absolute
Current.Get | | f | real | current [A]: 0
Current.100Get | | f | real | current [A]: 0
Current.BEEMGet | | f | real | current [A]: 0
Current.GainsGet | | SA i SA i | real | gains, index, filters, index
Current.GainSet | i/-1 i/-1 | | real | index of gain and filter
Current.CalibrSet/Get | @i d d | d d | kept 1 | calibration, offset of a gain
Piezo.TiltSet/Get | f f | f f | kept | plane correction [deg]
Piezo.RangeSet/Get | f f f | f f f | real | full ranges x, y, z [m]
Piezo.SensSet/Get | f f f | f f f | kept 1e-7 1e-7 1e-7 | sensitivities [m/V]
Piezo.CalibrGet | | f f f | real | sensitivities [m/V]
Piezo.DriftCompSet | I! f f f f | | real | on, velocities [m/s], limit [%]
Piezo.DriftCompGet | | I f f f I I I f | real | on, velocities, saturated, limit
Piezo.XYZLimitsSet/Get | H f f f f f f | H f f f f f f | kept | limits [V]
Piezo.HVAInfoGet | | f f f f I I I | real | gains, enabled
UserOut.ValSet | @i f | | kept | value of an output
UserOut.ModeSet/Get | @i H | H | kept | mode of an output
UserOut.MonitorChSet/Get | @i i | i | kept | signal of an output
UserOut.CalcSignalNameSet/Get | @i S | S | kept | name of a calculated output
UserOut.CalcSignalConfigSet/Get | @i H H H | H H H | kept | calculated output
UserOut.CalibrSet | @i f f | | kept 1 | calibration, offset of an output
UserOut.LimitsSet/Get | @i f f I | f f | kept 10 -10 0 | upper, lower limit of an output
SafeTip.OnOffSet/Get | H! | H | kept | safe tip
SafeTip.PropsSet/Get | H H f | H H f | kept | auto recovery, auto pause, threshold
SafeTip.SignalGet | | f | real | watched signal: the vertical deflection
TipShaper.PropsSet/Get | f I f f f f f f f f I | f I f f f f f f f f I | kept | panel of the tip shaper
TipShaper.Start | I i | | done | wait, timeout [ms]
TipRec.BufferSizeSet/Get | i | i | kept 1000 | size of the buffer
TipRec.BufferClear | | | done | empty the buffer
TipRec.DataSave | I S | | done | clear, base name
TipRec.DataGet | | *i M | real | channels, table: empty
Marks.LineDraw | f f f f I | | done | line
Marks.PointDraw | f f S I | | done | point with a text
Marks.PointsErase | i | | done | erase points
Marks.LinesErase | i | | done | erase lines
Motor.StartMove | I H I I | | done | direction, steps, group, wait
Motor.StartClosedLoop | I d d d I I | | done | target, wait, group
Motor.StopMove | | | done | stop
Motor.PosGet | I I | d d d | real | position: not available
Motor.StepCounterGet | I I I | i i i | real | counters: not available
Motor.FreqAmpSet | f f H | | real | frequency [Hz], amplitude [V], axis
Motor.FreqAmpGet | H | f f | real | frequency [Hz], amplitude [V]
OCSync.AnglesSet/Get | f f f f | f f f f | kept | angles [deg]
OCSync.LinkAnglesSet/Get | I I | I I | kept | linked angles
MPass.Activate | I | | done | multi-pass: not done
MPass.Load | S | | done | file of a multi-pass
MPass.Save | S | | done | file of a multi-pass
Util.VersionGet | | S S I I | real | product, version, releases
Util.SessionPathGet | | S | real | folder of saved files
Util.SessionPathSet | S I | | real | folder of saved files
Util.SettingsLoad | S I | | done | file of settings
Util.SettingsSave | S I | | done | file of settings
Util.LayoutLoad | S I | | done | file of a layout
Util.LayoutSave | S I | | done | file of a layout
Util.RTFreqSet/Get | f | f | kept 20000 | rate of the loop [Hz]
Util.AcqPeriodSet/Get | f | f | kept 0.02 | acquisition period [s]
Util.RTOversamplSet/Get | i | i | kept 10 | oversampling
Util.Lock | | | done | lock the screen
Util.UnLock | | | done | unlock the screen
DataLog.Open | | | done |
DataLog.Start | | | done |
DataLog.Stop | | | done |
DataLog.ChsSet/Get | *i | *i | kept | channels
DataLog.PropsSet | H i i f i S/"" S/"" SA | | kept | properties
DataLog.PropsGet | | H i i f i S S | real | properties
DataLog.StatusGet | | S H H f S S i | real | start, elapsed, stop, path, points: idle
"""
LOCK_INS = """
LockIn.ModOnOffSet/Get | @i I | I | kept | modulator
LockIn.ModSignalSet/Get | @i i | i | kept | modulated signal
LockIn.ModPhasRegSet/Get | @i i | i | kept | phase register
LockIn.ModHarmonicSet/Get | @i i | i | kept 1 | harmonic
LockIn.ModPhasSet/Get | @i f | f | kept | phase [deg]
LockIn.ModAmpSet/Get | @i f | f | kept | amplitude
LockIn.ModPhasFreqSet/Get | @i d | d | kept 1000 | frequency [Hz]
LockIn.DemodSignalSet/Get | @i i | i | kept | demodulated signal
LockIn.DemodHarmonicSet/Get | @i i | i | kept 1 | harmonic
LockIn.DemodHPFilterSet/Get | @i i/-1 f | i f | kept | order, cut-off [Hz]
LockIn.DemodLPFilterSet/Get | @i i/-1 f | i f | kept | order, cut-off [Hz]
LockIn.DemodPhasRegSet/Get | @i i | i | kept | phase register
LockIn.DemodPhasSet/Get | @i f | f | kept | phase [deg]
LockIn.DemodSyncFilterSet/Get | @i I | I | kept | sync filter
LockIn.DemodRTSignalsSet/Get | @i I | I | kept | signals
Osci1T.ChSet/Get | i | i | used | channel
Osci1T.TimebaseSet | i/-1 | | real | index of the time base
Osci1T.TimebaseGet | | i *f | real | index, time bases [s]
Osci1T.TrigSet/Get | H H d d | H H d d | kept | trigger
Osci1T.Run | | | done | start
Osci1T.DataGet | H | d d *d | real | t0, dt [s], values
Osci2T.ChsSet/Get | i i | i i | used | channels
Osci2T.OversamplSet/Get | H | H | kept | oversampling
Osci2T.TimebaseSet | H | | real | index of the time base
Osci2T.TimebaseGet | | H *f | real | index, time bases [s]
Osci2T.TrigSet/Get | H H H d d d | H H H d d d | kept | trigger
Osci2T.Run | | | done | start
Osci2T.DataGet | H | d d *d *d | real | t0, dt [s], values
PLL.OutOnOffSet/Get | @i I | I | kept | drive
PLL.AmpCtrlOnOffSet/Get | @i I | I | kept | amplitude controller
PLL.PhasCtrlOnOffSet/Get | @i I | I | kept | phase controller
PLL.FreqShiftSet/Get | @i f | f | kept | frequency shift [Hz]
PLL.FreqShiftAutoCenter | i | | real | the centre takes the shift over
PLL.CenterFreqSet/Get | @i d | d | kept 100000 | centre [Hz]
PLL.ExcitationSet/Get | @i f | f | kept | excitation [V]
PLL.AmpCtrlSetpntSet/Get | @i f | f | kept | amplitude [m]
PLL.AmpCtrlGainSet | @i f f | | real | P [V/m], T [s]
PLL.AmpCtrlGainGet | @i | f f f | real | P, T, I
PLL.PhasCtrlGainSet | @i f f | | real | P [Hz/deg], T [s]
PLL.PhasCtrlGainGet | @i | f f f | real | P, T, I
PLL.AmpCtrlBandwidthSet/Get | @i f | f | kept | bandwidth [Hz]
PLL.PhasCtrlBandwidthSet/Get | @i f | f | kept | bandwidth [Hz]
PLL.FreqRangeSet/Get | @i f | f | kept | range [Hz]
PLL.InpCalibrSet/Get | @i f | f | kept 1e-8 | calibration [m/V]
PLL.InpRangeSet/Get | @i f | f | kept 1e-6 | range [m]
PLL.InpPropsSet/Get | @i H H | H H | kept | differential, 1/10
PLL.ExcRangeSet/Get | @i H | H | kept | range of the output
PLL.AddOnOffSet/Get | @i I | I | kept | add
PLL.FreqExcOverwriteSet/Get | @i i/-2 i/-2 | i i | kept | signals
PLL.DemodInputSet/Get | @H H H | H H | kept | input
PLL.DemodHarmonicSet/Get | @H H | H | kept 1 | harmonic
PLL.DemodFilterSet/Get | @H H | H | kept | filter
PLL.DemodPhasRefSet/Get | @H f | f | kept | phase [deg]
PLLFreqSwp.Open | i | | done |
PLLFreqSwp.Stop | i | | real | stop the sweep
PLLFreqSwp.ParamsSet/Get | @i i/-1 f/nan f/nan | i f f | used 101 0.01 0.1 | points, period [s], settling [s]
PLLFreqSwp.Start | i I I | SA M d d f f i i | real | names, data, resonance [Hz], Q, phase [deg], ratio, points
"""
MOTION = """
FolMe.XYPosGet | I | d d | real | place of the tip [m]
FolMe.XYPosSet | d d I | | real | move, wait
FolMe.SpeedSet/Get | f I | f I | real | speed [m/s]; 1 = this one, 0 = that of scans
FolMe.Stop | | | real | stop the move
FolMe.OversamplSet | i | | done | oversampling
FolMe.OversamplGet | | i f | real | oversampling, rate [Hz]
FolMe.PSOnOffSet/Get | I | I | kept | point and shoot
FolMe.PSExpGet | | H SA | real | experiment of point and shoot, list
FolMe.PSExpSet | H | | done | experiment of point and shoot
FolMe.PSPropsSet/Get | I! I! S/"" S/"" f | I I S S f | kept | point and shoot
ZCtrl.ZPosGet | | f | real | Z [m], larger = farther from the sample
ZCtrl.ZPosSet | f | | real | Z [m]; no effect while the controller is on
ZCtrl.OnOffSet/Get | I | I | real | feedback
ZCtrl.StatusGet | | H | real | 1 off 2 on 3 hold 4 switching off 6 withdrawing
ZCtrl.SetpntSet/Get | f | f | real | setpoint, in the unit of the controller
ZCtrl.GainSet/Get | f f f | f f f | real | P, time constant [s], I
ZCtrl.SwitchOffDelaySet/Get | f | f | used | Z is averaged over this [s] when the controller is switched off
ZCtrl.TipLiftSet/Get | f | f | used | then Z goes up by this [m]
ZCtrl.HomePropsSet/Get | H< f | H f | used | 0 absolute 1 relative, Z [m]
ZCtrl.Home | | | real | to the home position
ZCtrl.CtrlListGet | | SA i | real | controllers, index
ZCtrl.ActiveCtrlSet | i | | real | index of the controller
ZCtrl.WithdrawRateSet/Get | f | f | used 1e-5 | rate [m/s]
ZCtrl.Withdraw | I i | | real | wait, timeout [ms]
ZCtrl.LimitsEnabledSet/Get | I | I | real | limits of Z
ZCtrl.LimitsSet/Get | f f | f f | real | high, low [m]
AutoApproach.Open | | | done |
AutoApproach.OnOffSet/Get | H | H | real | approach; 1 = running
"""
MEASURING = """
Signals.NamesGet | | SA | real | 128 names
Signals.InSlotsGet | | SA *i | real | 24 slots
Signals.InSlotSet | i i | | done | slot, signal
Signals.CalibrGet | i | f f | real | calibration, offset
Signals.RangeGet | i | f f | real | max, min
Signals.ValGet | i I | f | real | signal, wait for a new one
Signals.ValsGet | *i I | *f | real | signals at one instant
Signals.MeasNamesGet | | SA | real | names that can be recorded
Signals.AddRTGet | | SA S S | real | further signals
Signals.AddRTSet | i i | | done | further signals
BeamDefl.VerConfigSet/Get | S/"" S/"" f f | S S f f | used "Vert. Deflection" V 1 0 | name, units, units/V, offset
BeamDefl.HorConfigSet/Get | S/"" S/"" f f | S S f f | used "Horiz. Deflection" V 1 0 | name, units, units/V, offset
BeamDefl.IntConfigSet/Get | S/"" S/"" f f | S S f f | kept Intensity V 1 0 | name, units, units/V, offset
BeamDefl.AutoOffset | H | | real | 0 horizontal 1 vertical 2 intensity: the present value becomes zero
Scan.Action | H I | | real | 0 start 1 stop 2 pause 3 resume 6 frame to the tip; 1 = up
Scan.StatusGet | | I | real | 1 = running
Scan.FrameSet/Get | f f f f f | f f f f f | real | centre, width, height [m], angle [deg, clockwise]
Scan.BufferSet | *i i i | | real | channels, pixels, lines
Scan.BufferGet | | *i i i | real | channels, pixels, lines
Scan.PropsSet | I! I! I S/"" S/"" SA I | | real | continuous, bouncy, autosave, series, comment, modules, autopaste
Scan.PropsGet | | I I I S S SA *i T I | real | the same
Scan.SpeedSet/Get | f f f f H f | f f f f H f | real | speeds [m/s], times a line [s], what stays, ratio
Scan.FrameDataGrab | I I | S M I | real | channel, direction; name, rows from the top, 1 = up
Scan.XYPosGet | I | f f | real | place of the tip [m]
Scan.WaitEndOfScan | i | I S | real | timeout [ms]; 1 = timed out, file
Scan.WaitEndOfLine | i | I i H i | real | timeout [ms]; timed out, line, way, pass
Scan.Save | I i | I | real | wait, timeout [ms]; timed out
Scan.BackgroundPaste | I i | I | done | background
Scan.BackgroundDelete | I i I | I | done | background
BiasSpectr.Open | | | done |
BiasSpectr.Start | I S | SA M *f | real | get data, base name; names, data, parameters
BiasSpectr.Stop | | | real | stop
BiasSpectr.StatusGet | | I | real | 1 = running
BiasSpectr.ChsSet | *i | | real | channels
BiasSpectr.ChsGet | | *i SA | real | channels
BiasSpectr.PropsSet | H! i H! i f/nan H! H! | | real | save all, sweeps, backward, points, z offset [m], autosave
BiasSpectr.PropsGet | | H i H i SA SA SA H H | real | the same
BiasSpectr.AdvPropsSet/Get | H! H! H! H! | H H H H | kept 1 1 | reset bias, z hold, final z, lock-in
BiasSpectr.LimitsSet/Get | f f | f f | used -1 1 | start, end [V]
BiasSpectr.TimingSet/Get | f/nan f/nan f/nan f/nan f/nan f/nan f/nan f/nan | f f f f f f f f | used 0 0 0 1 2e-3 | [s]
BiasSpectr.AltZCtrlSet/Get | H! f/nan f/nan | H f f | kept | alternate setpoint
BiasSpectr.MLSModeSet/Get | S | S | kept Linear | mode
BiasSpectr.MLSLockinPerSegSet/Get | I | I | kept | lock-in by segments
BiasSpectr.MLSValsSet/Get | *f =f =f =f =f =i =I | *f =f =f =f =f =i =I | kept | segments
ZSpectr.Open | | | done |
ZSpectr.Start | I S | SA M *f | real | get data, base name; names, data, parameters
ZSpectr.Stop | | | real | stop
ZSpectr.StatusGet | | I | real | 1 = running
ZSpectr.ChsSet | *i | | real | channels
ZSpectr.ChsGet | | *i SA | real | channels
ZSpectr.PropsSet | H! i H/0 H! H! H! | | real | backward, points, sweeps, autosave, dialog, save all
ZSpectr.PropsGet | | H i SA SA H H | real | backward, points, parameters, fixed parameters, sweeps, save all
ZSpectr.RangeSet/Get | f f | f f | used 1e-7 -2e-7 | Z offset before the sweep, distance [m]
ZSpectr.TimingSet/Get | f/nan f/nan f/nan f/nan f/nan f/nan f/nan | f f f f f f f | used 0 2e-3 1 0 2e-4 | timing [s]
ZSpectr.AdvPropsSet/Get | f H! H! H! | f H H H | kept | time between sweeps [s], final z, lock-in, reset z
ZSpectr.RetractDelaySet/Get | f | f | used | rest at the end of the sweep [s]
ZSpectr.RetractSet/Get | H! f i/-1 H/2 | H f i H | used 0 0 1 0 | auto retract: on, threshold, signal, 0 > 1 <
ZSpectr.RetractSecondSet/Get | i< f i/-1 H/2 | i f i H | kept 0 0 1 0 | second condition: kept only
ZSpectr.DigSyncSet/Get | H | H | kept | digital sync
ZSpectr.TTLSyncSet/Get | H H f f | H H f f | kept | TTL sync
ZSpectr.PulseSeqSyncSet/Get | H I | H I | kept | pulse sequence
TCPLog.ChsSet | *i | | real | channels of the data stream
TCPLog.OversamplSet | i | | real | oversampling of the data stream
TCPLog.Start | | | real | start the data stream
TCPLog.Stop | | | real | stop the data stream
TCPLog.StatusGet | | i | real | 1 idle 4 running
"""
ALIASES = {"ZSpectr.Retract2ndSet": "ZSpectr.RetractSecondSet", "ZSpectr.Retract2ndGet": "ZSpectr.RetractSecondGet"}
"""Other spellings of clients."""
_TYPE = re.compile(r"(@?)([*=]?)(SA|[HhIifdSMT])([!<]?)(?:/(.*))?")


@dataclass(frozen=True)
class Field:
    """One argument or return value."""

    type: str
    many: str = ""  # `*`: a count and so many; `=`: as many as the count before
    index: bool = False
    flag: str = ""  # `!` or `<`
    keep: Any = None  # value that leaves a setting as it is

    @property
    def empty(self) -> Any:
        """What stands where a client leaves it out."""
        return [] if self.many or self.type in ("SA", "M", "T") else "" if self.type == "S" else 0


@dataclass(frozen=True)
class CommandRow:
    """One row, for one command."""

    name: str
    arguments: tuple[Field, ...]
    returns: tuple[Field, ...]
    how: str
    meaning: str
    setting: str = ""
    """Of a command STORED: name of what is stored."""
    before: tuple[Any, ...] = ()
    """And its values before they are set."""

    @property
    def sets(self) -> bool:
        """Whether it is a Set."""
        return self.name.endswith("Set")


def _field(word: str) -> Field:
    found = _TYPE.fullmatch(word)
    assert found, word
    index, many, kind, flag, keep = found.groups()
    value: Any = None
    if keep is not None:
        value = "" if keep == '""' else float(keep)
    return Field(kind, many, bool(index), flag, value)


def _fields(words: str) -> tuple[Field, ...]:
    return tuple(_field(word) for word in words.split())


def _value(field: Field, word: str) -> Any:
    return word if field.type == "S" else float(word) if field.type in "fd" else int(float(word))


def _rows(text: str) -> dict[str, CommandRow]:
    found: dict[str, CommandRow] = {}
    for line in text.strip().splitlines():
        name, given, back, how, meaning = (cell.strip() for cell in line.split("|"))
        arguments, returns = _fields(given), _fields(back)
        how, *words = shlex.split(how)
        own = [each for each in arguments if not each.index] or list(returns)
        before = tuple(_value(f, word) for f, word in zip(own, words, strict=False))
        before += tuple(field.empty for field in own[len(before) :])
        base = name.removesuffix("Set/Get") if name.endswith("Set/Get") else name.removesuffix("Set")
        if not name.endswith("/Get"):
            found[name] = CommandRow(name, arguments, returns, how, meaning, base, before)
            continue
        indices = tuple(each for each in arguments if each.index)
        found[f"{base}Set"] = CommandRow(f"{base}Set", arguments, (), how, meaning, base, before)
        found[f"{base}Get"] = CommandRow(f"{base}Get", indices, returns, how, meaning, base, before)
    return found


COMMANDS: dict[str, CommandRow] = _rows(SETTINGS) | _rows(LOCK_INS) | _rows(MOTION) | _rows(MEASURING)
"""By name."""
COMMANDS |= {alias: COMMANDS[name] for alias, name in ALIASES.items()}
