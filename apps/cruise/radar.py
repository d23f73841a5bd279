"""A radar and a motor for `cruise`, at the other end of a network.

Says every 20 ms how far the car ahead is, and follows the speed that comes back:
radar.py PORT SECONDS [FILE], which gets the speeds.
"""

import socket
import sys
import time

port, seconds = int(sys.argv[1]), float(sys.argv[2])
speeds = open(sys.argv[3] if len(sys.argv) > 3 else "/dev/stdout", "wb")
wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
wire.settimeout(0.02)
gap, ahead, speed, answers = 4000.0, 1500, 0, 0  # cm, cm/s
end = time.monotonic() + seconds
while time.monotonic() < end:
    wire.sendto(b"gap %d" % max(0, gap), ("127.0.0.1", port))
    try:
        line = wire.recv(2000)
        answers += 1
        speeds.write(line)
        speed = int(line.split()[1])
        time.sleep(0.02)
    except TimeoutError:
        pass
    gap += (ahead - speed) * 0.02
speeds.flush()
print(f"{answers} answers, the gap is {gap:.0f} cm", file=sys.stderr)
