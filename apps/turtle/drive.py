"""Drives `turtle` once around a square, as a node of ROS 2 does, and draws what its odometry says."""

import argparse
import json
import math
import re
import struct
import sys
import time

import zenoh
from rosbags.typesys import Stores, get_typestore


def place(text):
    if text == "router" or re.fullmatch(r"(tcp|udp)/[^/]+:[0-9]+", text):
        return text
    raise argparse.ArgumentTypeError(f"`{text}`: allowed are `router` and such as tcp/127.0.0.1:7447")


parser = argparse.ArgumentParser(description=__doc__, epilog="Needs eclipse-zenoh and rosbags.")
about = "where the router is, such as tcp/127.0.0.1:7447; `router`: it is this, on udp port 7447"
parser.add_argument("endpoint", nargs="?", default="router", type=place, help=about)
parser.add_argument("picture", nargs="?", default="turtle.svg", help="the file for the picture")
options = parser.parse_args()
types = get_typestore(Stores.ROS2_JAZZY)
Twist, Vector3 = (types.types[f"geometry_msgs/msg/{name}"] for name in ("Twist", "Vector3"))
path, heard, sent = [], {}, []


def key(topic, package, name):
    """The key of a topic in domain 0, as rmw_zenoh has it."""
    hash = types.hash_rihs01(f"{package}/msg/{name}")
    return f"0/{topic}/{package}::msg::dds_::{name}_/{hash}"


def hear(sample):
    topic = str(sample.key_expr).split("/")[1]
    assert len(bytes(sample.attachment)) == 33
    heard[topic] = heard.get(topic, 0) + 1
    if topic == "odom":
        odom = types.deserialize_cdr(bytes(sample.payload), "nav_msgs/msg/Odometry")
        path.append((odom.pose.pose.position.x, odom.pose.pose.position.y))


def drive(forward, turn, seconds):
    linear, angular = Vector3(x=forward, y=0.0, z=0.0), Vector3(x=0.0, y=0.0, z=turn)
    cdr = bytes(types.serialize_cdr(Twist(linear=linear, angular=angular), "geometry_msgs/msg/Twist"))
    for _ in range(round(seconds * 10)):
        sent.append(time.time_ns())
        commands.put(cdr, attachment=struct.pack("<qqB16s", len(sent), sent[-1], 16, b"drive.py"))
        time.sleep(0.1)


config = zenoh.Config()
is_router = options.endpoint == "router"
config.insert_json5("mode", json.dumps("router" if is_router else "client"))
where = "listen/endpoints" if is_router else "connect/endpoints"
config.insert_json5(where, json.dumps(["udp/0.0.0.0:7447" if is_router else options.endpoint]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
listening = [
    session.declare_subscriber(key(*topic), hear)
    for topic in (("odom", "nav_msgs", "Odometry"), ("imu", "sensor_msgs", "Imu"))
]
commands = session.declare_publisher(key("cmd_vel", "geometry_msgs", "Twist"))
end = time.monotonic() + 30
while not path and time.monotonic() < end:
    time.sleep(0.1)
if not path:
    sys.exit("no odometry came in 30 s; join `turtle` to this router")
for _ in range(4):
    drive(0.3, 0.0, 3.0)
    drive(0.0, 0.0, 0.5)
    drive(0.0, math.pi / 4, 2.0)
    drive(0.0, 0.0, 0.5)
session.close()
points = " ".join(f"{100 * x:.1f},{-100 * y:.1f}" for x, y in path)
style = 'viewBox="-20 -120 140 140" fill="none" stroke="black"'
with open(options.picture, "w") as file:
    file.write(f'<svg xmlns="http://www.w3.org/2000/svg" {style}><polyline points="{points}"/></svg>\n')
print(f"{len(sent)} commands, {heard}; its furthest corner is {max(path, key=sum)}")
