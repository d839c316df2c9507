# SPDX-License-Identifier: Apache-2.0
"""Records with the user's code of lab.py on Ray: python record.py OUT RUNTIME_ENV. Prints the sensors' values, or the error."""

import json
import sys

sys.path.insert(0, "code")
import lab

import mjsense as mjs
from mjsense.cluster import Job, record_on_ray

out, environment = sys.argv[1], json.loads(sys.argv[2])
arguments = {"task": lab.Look, "policy": lab.Still, "sensors": [lab.Length()], "keep_failures": True, "cameras": [], "num_worlds": 1}
try:
    record_on_ray(Job(out, arguments), episodes=1, max_attempts=1, runtime_env=environment)
    episode = mjs.Dataset(out).episodes[0]
    print(episode["obs/extra/length"][0].tolist(), episode["obs/extra/of_robot"][0].tolist())
except Exception as error:
    print(f"{type(error).__name__}: {error}")
