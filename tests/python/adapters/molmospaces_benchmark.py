# SPDX-License-Identifier: Apache-2.0
"""MolmoSpaces' schema reads benchmarks that mjsense has exported, and writes them again.

Arguments: folders of benchmarks, each of which gets a folder with the name NAME_again.
"""

import importlib.util
import json
import sys
from pathlib import Path

# The module alone, because its package imports all of MolmoSpaces.
found = importlib.util.find_spec("molmo_spaces")
path = Path(found.submodule_search_locations[0]) / "evaluation/benchmark_schema.py"
spec = importlib.util.spec_from_file_location("benchmark_schema", path)
schema = importlib.util.module_from_spec(spec)
sys.modules["benchmark_schema"] = schema
spec.loader.exec_module(schema)

TASKS = {
    "PickTask": schema.PickTaskSpec,
    "PickAndPlaceTask": schema.PickAndPlaceTaskSpec,
    "PickAndPlaceNextToTask": schema.PickAndPlaceNextToTaskSpec,
    "OpeningTask": schema.OpenCloseTaskSpec,
    "DoorOpeningTask": schema.DoorOpeningTaskSpec,
    "NavToObjTask": schema.NavToObjTaskSpec,
}

for folder in map(Path, sys.argv[1:]):
    episodes = schema.load_all_episodes(folder)
    assert episodes
    for episode in episodes:
        module, _, name = episode.get_task_cls().rpartition(".")
        (file,) = path.parents[1].glob(f"tasks/{module.rpartition('.')[2]}.py")
        assert f"class {name}(" in file.read_text(), episode.get_task_cls()
        assert TASKS[name].model_validate(episode.task).robot_base_pose == episode.task["robot_base_pose"]
        # What JsonEvalTaskSampler requires.
        assert episode.scene_dataset and episode.data_split and episode.robot.init_qpos and episode.language.task_description
        kinds = {camera.name: type(camera).__name__ for camera in episode.cameras}
        assert kinds and set(kinds.values()) <= {"RobotMountedCameraSpec", "ExocentricCameraSpec"}, kinds
        for name in episode.task_relevant_objects:
            assert "pickup_obj_name" not in episode.task or name in episode.scene_modifications.object_poses or "joint_name" in episode.task
    again = folder.with_name(f"{folder.name}_again")
    again.mkdir()
    (again / "benchmark.json").write_text(json.dumps([episode.model_dump() for episode in episodes]))
