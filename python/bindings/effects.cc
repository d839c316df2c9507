// SPDX-License-Identifier: Apache-2.0
// A chain of effects that is driven by hand.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <numeric>
#include <optional>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/effects/all_effects.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/numpy.h"

namespace mjsense::python {

namespace {

// Effects on float32 rows [B, D] that come from anywhere.
class PyChain {
 public:
  PyChain(nb::handle config, int size, int num_worlds, double period, std::uint64_t seed)
      : seed_(seed) {
    if (num_worlds < 1 || size < 1)
      throw ValueError("a chain needs at least one world and one component");
    if (!(period > 0)) throw ValueError("period must be positive (s)");
    EffectChainCfg cfg;
    read_struct(config, cfg);
    SensorSpec spec;
    spec.name = "pipeline";
    spec.shape = {size};
    chain_ = std::make_unique<EffectChain>("pipeline", spec, cfg, num_worlds, period, period);
    out_ = std::make_shared<Array>(DType::kFloat32, chain_->spec().shape.with_front(num_worlds));
    worlds_.resize(num_worlds);
    reset(std::nullopt);
  }

  // None: all worlds.
  void reset(const std::optional<std::vector<int>>& chosen) {
    std::vector<int> ids(worlds_.size());
    std::iota(ids.begin(), ids.end(), 0);
    if (chosen) ids = *chosen;
    for (int w : ids) {
      if (w < 0 || w >= static_cast<int>(worlds_.size()))
        throw ValueError("world id " + std::to_string(w) + " is out of range");
    }
    for (int w : ids) {
      ++worlds_[w].episode;
      chain_->reset(tick(w));
    }
  }

  using Rows = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
  nb::object apply(const Rows& rows) {
    const std::size_t bytes = rows.shape(1) * sizeof(float);
    if (rows.shape(0) != worlds_.size())
      throw ValueError("expected one row for each of " + std::to_string(worlds_.size()) +
                       " worlds");
    for (std::size_t w = 0; w < worlds_.size(); ++w) {
      ++worlds_[w].tick;
      const auto* in = reinterpret_cast<const std::byte*>(rows.data()) + w * bytes;
      chain_->apply(tick(static_cast<int>(w)), {in, bytes},
                    {out_->row_data(static_cast<int>(w)), out_->row_bytes()});
    }
    return to_numpy(out_->view(), owner_of(out_));
  }

 private:
  struct World {
    std::int64_t tick = -1, episode = 0;
  };
  ChainTick tick(int w) const {
    return {w, static_cast<std::uint32_t>(w), seed_, worlds_[w].tick, worlds_[w].episode};
  }
  std::unique_ptr<EffectChain> chain_;
  std::shared_ptr<Array> out_;
  std::vector<World> worlds_;
  std::uint64_t seed_;
};

}  // namespace

void bind_effects(nb::module_& m) {
  nb::class_<PyChain>(m, "EffectChain", "Effects on rows that come from anywhere.")
      .def(nb::init<nb::handle, int, int, double, std::uint64_t>(), nb::arg("config"),
           nb::arg("size"), nb::arg("num_worlds"), nb::arg("period"), nb::arg("seed"))
      .def("reset", &PyChain::reset, nb::arg("world_ids").none())
      .def("apply", &PyChain::apply, nb::arg("rows"));
}

}  // namespace mjsense::python
