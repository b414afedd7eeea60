"""Every fault that a check can find, by name, and what to do about it."""

REMEDIES = {
    # the file
    "hostile archive": "do not trust this file; ask for the FMU to be packed again by its exporter",
    "path traversal": "do not trust this file; ask for the FMU to be packed again by its exporter",
    "zip bomb": "do not trust this file; ask for the FMU to be packed again by its exporter",
    "entity expansion": "do not trust this file; ask for a model description without a document type",
    "unreadable": "ask for the file again, exported as an FMI 2.0 co-simulation FMU for this platform",
    "binding does not fit": "mend the binding; `gfor bind` drafts one from this file",
    "invalid FMI": "have the exporter corrected; `fmpy validate` lists all problems",
    "wrong units": "have the unit corrected in modelDescription.xml; what it means cannot be known otherwise",
    "bad start values": "have the start values declared as FMI 2.0 asks",
    "start values differ": "have the declared start values corrected: a master shows them and leaves them as they are",
    # the process
    "crash": "ask the author for a corrected FMU; until then it runs in a process of its own only",
    "hang": "ask the author for a corrected FMU, or raise --time-limit if it is only slow",
    "exit": "an FMU must return fmi2Fatal and never end the process; ask the author",
    "output flood": "an FMU must log through its logger, and only what matters; ask the author",
    "memory limit": "ask why it needs so much memory, or raise --memory-limit",
    "forbidden file access": "ask why it writes outside of its own folder",
    "no instance": "ask the author what the FMU's message means",
    "error in a step": "ask the author what the FMU's message means",
    "refused call": "ask the author why it refuses what it declares to be able to do",
    "memory leak": "what is allocated must be freed; until then use short runs",
    # the same answer
    "not repeatable": "look for numbers that are never set, random numbers, or clocks",
    "reading changes it": "a getter must not change the FMU",
    "shared between instances": "static variables must become members of the instance; until then use one a process",
    "reset fails": "fmi2Reset must lead back to where fmi2Instantiate led; instantiate anew instead",
    "reset leaves something": "fmi2Reset must set every variable and parameter back; instantiate anew instead",
    "no second instance": "fmi2FreeInstance must leave room for another one",
    "instances differ": "look for static variables that live longer than the instance",
    "hidden state": "all that changes must be in the saved state; until then neither linearise nor repeat steps",
    "growing state": "the state must not keep its past; ask the author",
    "serialised state": "have fmi2SerializeFMUstate and fmi2DeSerializeFMUstate corrected, or do not declare them",
    "incomplete state": "the state must hold all continuous states; ask the author",
    # time
    "undeclared feed-through": "have ModelStructure corrected: a master orders its calls by it, and misses the loop",
    "delayed output": "outputs must be those of the communication point, computed when they are read",
    "step-dependent answer": "the answer must follow communicationStepSize and not the number of calls",
    "internal step leaks": "time left between internal steps must be carried over, not dropped or rounded",
    # numbers
    "not a number": "an FMU must return fmi2Error where it has no answer, or limit what it is given",
    "not a number stays": "look for static variables",
    # the port
    "does not start": "it must start from a power flow within its ratings",
    "no steady state": "it must compute its states from the power flow; otherwise let it settle before linearising",
    "wrong sign": "turn 'direction', 'form', 'signs' or 'frame_angle' of the binding, or have the FMU corrected",
    "wrong base": "check unit, base and 'value' (rms or peak, phase or line) of current, voltage and start values",
    "wrong frame": "set 'frame_angle' of the binding, or 'dq' for 'qd'",
    "wrong axes": "check form, axes and 'signs' of the binding, one by one",
    "power not as asked": "check which variables take the start values, their bases, and the voltage's base",
}
