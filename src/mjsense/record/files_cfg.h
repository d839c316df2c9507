// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of the files of a recording, declared once for all that write one: recordings of tasks,
// recorders of user-defined loops and environments, renderings and imports.

#include "mjsense/record/video_cfg.h"

namespace mjsense::record {

struct FilesCfg {
  int episodes = 1;
  bool resume = false, append = false, overwrite = false;
  int house = 0, batches = 0, gzip = 4;
  VideoCfg video;
};
template <class V>
void visit_fields(V& v, FilesCfg& c) {
  v.object("FilesCfg", "The files of a recording.");
  v("episodes", c.episodes, "Number of episodes to keep.").at_least(1);
  v("resume", c.resume,
    "Continue an interrupted recording; all settings that affect the data must be unchanged.");
  v("append", c.append,
    "Add new episodes to a completed recording; all settings that affect the data must be "
    "unchanged.");
  v("overwrite", c.overwrite, "Replace an existing recording of this house.");
  v("house", c.house,
    "Number of the ``house_N`` folder in the output directory. Each house of a task has its own "
    "random numbers.")
      .at_least(0);
  v("batches", c.batches,
    "Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.")
      .at_least(0);
  v("gzip", c.gzip, "Compression level of arrays, 0 to 9.").within(0, 9);
  v.include(c.video);
}

}  // namespace mjsense::record
