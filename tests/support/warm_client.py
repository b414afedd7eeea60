"""Has a process of `tests.support.warm` do a command, with this one's output, and ends as it does.

python -I warm_client.py SOCKET WORDS
"""

import json
import os
import socket
import sys


def main() -> int:
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.connect(sys.argv[1])
    asked = {"words": sys.argv[2:], "env": dict(os.environ), "drawn": False, "folder": os.getcwd()}
    socket.send_fds(line, [json.dumps(asked).encode()], [1, 2])
    line.recv(64)  # its number
    code = int(line.recv(64).split()[0])
    return code if code >= 0 else 128 - code  # as a shell tells an end by a signal


if __name__ == "__main__":
    raise SystemExit(main())
