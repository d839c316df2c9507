// SPDX-License-Identifier: Apache-2.0
// Bindings of the observation pipeline for values from outside the simulation.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/effects/all_effects.h"
#include "mjsense/effects/pipeline.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/numpy.h"

namespace mjsense::python {

namespace {

// Applies effects to float32 rows [B, D]; D is determined by the first rows.
class PyPipeline {
 public:
  PyPipeline(nb::handle config, int num_worlds, std::uint64_t seed) : seed_(seed) {
    if (num_worlds < 1) throw ValueError("observation pipeline: num_envs must be at least 1");
    effects::PipelineCfg cfg;
    read_struct(config, cfg);
    cfg_ = effects::pipeline(cfg);
    worlds_.resize(num_worlds);
  }

  // None selects all worlds.
  void reset(const std::optional<std::vector<int>>& chosen) {
    std::vector<int> ids(worlds_.size());
    std::iota(ids.begin(), ids.end(), 0);
    if (chosen) ids = *chosen;
    for (int w : ids) {
      if (w < 0 || w >= static_cast<int>(worlds_.size()))
        throw ValueError("world id " + std::to_string(w) + " is out of range");
    }
    if (!chain_) return;  // no rows have been processed yet
    for (int w : ids) start_episode(w);
  }

  using Rows = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
  NumpyArray apply(const Rows& rows) {
    const auto size = static_cast<std::int64_t>(rows.shape(1));
    if (rows.shape(0) != worlds_.size() || size < 1 || (chain_ && size != size_)) {
      throw ValueError("shape (" + std::to_string(rows.shape(0)) + ", " + std::to_string(size) +
                       "): expected (" + std::to_string(worlds_.size()) + ", " +
                       (chain_ ? std::to_string(size_) : "D") + ")");
    }
    if (!chain_) make_chain(size);
    const auto out =
        std::make_shared<Array>(DType::kFloat32, chain_->spec().shape.with_front(rows.shape(0)));
    const std::size_t bytes = size * sizeof(float);
    for (int w = 0; w < static_cast<int>(worlds_.size()); ++w) {
      ++worlds_[w].tick;
      const auto* in = reinterpret_cast<const std::byte*>(rows.data()) + w * bytes;
      const std::span<std::byte> kept{out_.row_data(w), out_.row_bytes()};
      chain_->apply(tick(w), {in, bytes}, kept);
      std::memcpy(out->row_data(w), kept.data(), kept.size());
    }
    return to_numpy(out->view(), owner_of(out));
  }

 private:
  struct World {
    std::int64_t tick = -1, episode = 0;
  };
  effects::ChainTick tick(int w) const {
    return {w, static_cast<std::uint32_t>(w), seed_, worlds_[w].tick, worlds_[w].episode};
  }
  void make_chain(std::int64_t size) {
    SensorSpec spec;
    spec.name = "pipeline";
    spec.shape = {size};
    const int n = static_cast<int>(worlds_.size());
    auto chain = std::make_unique<effects::EffectChain>("pipeline", spec, cfg_, n, 1.0, 1.0);
    out_ = Array(DType::kFloat32, chain->spec().shape.with_front(n));
    chain_ = std::move(chain);
    size_ = size;
    for (int w = 0; w < n; ++w) start_episode(w);
  }
  void start_episode(int w) {
    ++worlds_[w].episode;
    chain_->reset(tick(w));
  }

  effects::EffectChainCfg cfg_;
  std::unique_ptr<effects::EffectChain> chain_;  // created with the first rows
  std::int64_t size_ = 0;
  Array out_;  // its output, which also stores the history
  std::vector<World> worlds_;
  std::uint64_t seed_;
};

}  // namespace

void bind_effects(nb::module_& m) {
  nb::class_<PyPipeline>(m, "ObservationPipeline", "The C++ pipeline.")
      .def(nb::init<nb::handle, int, std::uint64_t>(), nb::arg("config"), nb::arg("num_worlds"),
           nb::arg("seed"))
      .def("reset", &PyPipeline::reset, nb::arg("world_ids").none())
      .def("apply", &PyPipeline::apply, nb::arg("rows"));
}

}  // namespace mjsense::python
