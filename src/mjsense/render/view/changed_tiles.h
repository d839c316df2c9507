// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tiles of an image that may differ from an earlier image of the same scene. Every pixel depends on
// the view only. If all but the geoms is equal, a tile can differ only if it may show a geom that
// has changed, or if such a geom may cast a shadow on what the tile shows.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/render/view/light_space.h"
#include "mjsense/render/view/view.h"

namespace mjsense::render {

class ChangedTiles {
 public:
  // Number of geoms of the view that are as in the last view that was kept; -1 if all tiles differ
  // in any case.
  int equal_geoms(const View& view) const;

  // Finds the tiles that may differ from the image of the last view that was kept. Call keep()
  // when they have been rendered; otherwise all tiles of the next image differ.
  void compare(const View& view);
  void keep(const View& view);

  // For ImageTargets::changed_tiles and ImageTargets::receivers.
  const std::uint8_t* changed() const { return changed_.data(); }
  TileBox* receivers() { return receivers_.data(); }

 private:
  // A geom that differs: null where it is absent.
  struct Change {
    const ViewGeom *before, *now;
  };
  // A view that was kept, without what its pointers refer to.
  struct Kept {
    View view;
    std::vector<ViewGeom> geoms;
    std::vector<int> geom_index;  // in `geoms`, or -1

    const ViewGeom* find(const ViewGeom& geom) const;  // with the same id; null: none
    void assign(const View& view);
  };
  void mark_changes(const Kept& kept, const View& view);
  void mark_geom(const View& view, std::ptrdiff_t index, const ViewGeom& geom);
  void mark_shadows(const View& view);
  void mark_occlusion(const View& view);
  std::span<const LightWindow> shadow_windows(const View& view, const LightFrame& frame);

  bool complete_ = false;
  Kept shown_, reflected_;
  std::vector<std::uint8_t> changed_;
  std::vector<TileBox> receivers_;
  // Working memory.
  std::vector<Change> changes_;
  std::vector<std::uint8_t> present_;  // by geom
  struct {
    const LightFrame* frame;
    std::vector<LightWindow> windows;
  } windows_;  // shadow_windows() of the last frame
};

}  // namespace mjsense::render
