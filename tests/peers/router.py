"""A router of Zenoh on loopback: router.py PORT.

What it hears it says, a line each: `up IDENTITY`, `put KEY ATTACHMENT PAYLOAD` (bytes in hexadecimal,
`-` for none), `token KEY`, `gone KEY`, and what a command gives. Commands, on standard input:
`put KEY ATTACHMENT PAYLOAD`, and `decode TYPE PAYLOAD`, which shows a message as ROS 2 understands it.
"""

import json
import sys
import threading

import zenoh

saying = threading.Lock()


def say(*words):
    with saying:
        print(*words, flush=True)


def shown(data):
    return bytes(data).hex() if data and len(bytes(data)) else "-"


def from_shown(word):
    return bytes.fromhex(word.strip("-"))


def hear(sample):
    say("put", sample.key_expr, shown(sample.attachment), shown(sample.payload))


def see(sample):
    say("token" if sample.kind == zenoh.SampleKind.PUT else "gone", sample.key_expr)


zenoh.init_log_from_env_or("error")
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", json.dumps([f"udp/127.0.0.1:{sys.argv[1]}"]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
heard = session.declare_subscriber("**", hear)
tokens = session.liveliness().declare_subscriber("@ros2_lv/**", see, history=True)
say("up", session.info.zid())
for line in sys.stdin:
    command, name, *data = line.split()
    data = [from_shown(word) for word in data]
    if command == "put":
        # Where the way is full a router would drop values by itself.
        block = zenoh.CongestionControl.BLOCK
        session.put(name, data[1], attachment=data[0] or None, congestion_control=block)
    elif command == "decode":
        from rosbags.typesys import Stores, get_typestore

        say("value", get_typestore(Stores.ROS2_KILTED).deserialize_cdr(data[0], name))
session.close()
