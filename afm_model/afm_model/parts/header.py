"""The beginning of an instrument's block: the functions of its parts, and where everything stands in it."""

from ..compiled.records import Record


class BlockHeader(Record):
    """Of each part the addresses of its functions, 0 for one that it does not have, and the places of its records; the
    places of all else. Last, where in a row of the random numbers those of each source begin, and how long a row is.
    """

    program_reference: int
    program_watch: int
    program_constants: int
    program_state: int
    fault_on_sample: int
    fault_on_command: int
    fault_on_drive: int
    fault_on_measurement: int
    fault_constants: int
    fault_state: int
    piezo_actuate: int
    piezo_constants: int
    piezo_state: int
    onboard_regulate: int
    onboard_constants: int
    onboard_state: int
    plant_step: int
    plant_observe: int
    plant_constants: int
    plant_state: int
    sample_surface: int
    sample_constants: int
    sample_state: int
    detector_detect: int
    detector_constants: int
    detector_state: int
    loop: int
    measurement: int
    commanded: int  # the drive as commanded
    received: int  # behind a fault: its address
    applied: int  # behind range, resolution, delay
    regulated: int  # as changed by the onboard part
    effective: int  # as the piezo makes it
    asked: int  # the reference at this tick
    asked_next: int  # and at the next
    truth: int
    detection: int
    surface: int
    displacement: int  # what a fault does to the sample
    delivery: int  # and to a measurement
    sample_map: int
    plant_map: int
    plant_ledger: int
    score: int  # its sums
    hashed: int  # states of the parts, as recorded and hashed
    hashed_end: int
    line: int  # of drives on their way
    channels: int  # their places
    channel_count: int
    disturbance: int  # random numbers of the plant
    sensors: int
    read: int  # what the position sensors have read
    drift: int
    drifted: int
    limits: int
    guard: int
    position_noise: int
    noise: int  # of the detector
    wander: int  # of the drift
    faults: int
    draws: int  # length of a row


class LawHeader(Record):
    """The beginning of the block of a law, which may be in another process."""

    law_control: int
    law_constants: int
    law_state: int
    messages: int  # of a peer in its place (instrument/wire.py); 0: none
