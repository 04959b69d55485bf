"""Names and quality of service of every topic and service, relative to the instrument's namespace."""

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from afm_model.parameters import scenario
from afm_model.parts.channels import STANDARD

NAMESPACE = scenario.NAMESPACE
FRAME = "scanner"
"""frame_id of every stamped message: the scanner's axes, x fast, y slow, z up."""

MEASUREMENT = "measurement"
PIEZO_DRIVE = "piezo_drive"
DEFLECTION, LATERAL_FORCE, TRUTH_LATERAL_FORCE_Y, TRUTH_NORMAL_FORCE = (channel.name for channel in STANDARD)
CONTROL_TRACE = "control_trace"
LAW = "law"
"""Below it what the law estimates."""
STATUS = "status"
TELEMETRY = "telemetry"
SCORE = "score"
RECORDER_STATUS = "recorder_status"
EVENTS = "events"
SCAN_LINE = "scan_line"
RESULTS = "results"
PARAMETERS = "parameters"
IMAGE = "image"
MICROSCOPE = "microscope"

PLAY = "play"
PAUSE = "pause"
RESET = "reset"
PREVIEW_REFERENCE = "preview_reference"
ORDER_FAULT = "order_fault"
CLEAR_FAULTS = "clear_faults"
RESUME = "resume"
STEP = "step"
SET_SETPOINT = "set_setpoint"
SET_GAINS = "set_gains"
SET_FEEDBACK = "set_feedback"
SET_SAMPLE = "set_sample"
SET_PROBE = "set_probe"
SET_CALIBRATION = "set_calibration"
SET_Z_LIMITS = "set_z_limits"
STOP_VERB = "stop_verb"
READ_SIGNALS = "read_signals"


def clock(namespace: str) -> str:
    """Topic of simulated time: where ROS looks for it, or in the namespace of an instrument that has another one."""
    return "/clock" if namespace == f"/{NAMESPACE}" else "clock"


def client(goal_id: Sequence[int]) -> str:
    """Topic that the client of a goal may subscribe to: the simulator then knows for certain when that client has gone.

    It is named by the first 8 of the 16 bytes of the identifier of the goal, which the client chooses.
    """
    return f"client_{bytes(goal_id[:8]).hex()}"


def _reliable(depth: int, durability: DurabilityPolicy = DurabilityPolicy.VOLATILE) -> QoSProfile:
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=depth, durability=durability
    )


CONTROL_QOS = _reliable(10)
"""Measurement and PiezoDrive: nothing is lost at 1 kHz and beyond, where best effort of depth 1 loses up to 2 %."""
MEASUREMENT_QOS = _reliable(5000)
"""What the simulator keeps of Measurement for a recorder that is too slow: what it lacks is sent again."""
MEASUREMENT_IN_REALTIME_QOS = _reliable(2000)
"""The same in real time, where a controller that stood still is sent what it has missed first: no more than
it may lag, or its drives would be too old for ever.
"""
STREAM_QOS = _reliable(1000)
"""Blocks for recording: room for a recorder that is too slow for seconds."""
EVENTS_QOS = _reliable(100, DurabilityPolicy.TRANSIENT_LOCAL)
"""What has happened, and parameters, are kept for a recorder that joins late."""
SCAN_LINE_QOS = _reliable(1024, DurabilityPolicy.TRANSIENT_LOCAL)
"""Lines of a scan: those of an image of 512 lines are kept for whoever joins late."""
RESULTS_QOS = _reliable(100)
"""Arrays of results of verbs, a message each; of one result some ten."""
LATCHED_QOS = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
"""The last value is kept for whoever joins late."""
EVERY_STATE_QOS = _reliable(100, DurabilityPolicy.TRANSIENT_LOCAL)
"""Status for the recorder: with a depth of 1 a state is lost that is followed by another before the recorder looks."""
