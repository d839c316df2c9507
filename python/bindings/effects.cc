// Effects in Python: configurations of single effects, of a sensor seen through them, and a chain that is driven by hand.

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
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/effect_sensor.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"
#include "python/bindings/bindings.h"
#include "python/bindings/configs.h"
#include "python/bindings/numpy.h"

namespace mjsense::python {

// Words for enumerations, read by their own functions.
template <class Word>
void read_word(FromPython& f, nb::handle value, const char* field,
               Word (*from_name)(std::string_view), Word& out) {
  std::string name;
  f.read(field, value, name);
  try {
    out = from_name(name);
  } catch (const ValueError& e) {
    throw ValueError(config_place(f.config()) + ": " + e.what());
  }
}
void read_custom(FromPython& f, nb::handle value, Operation& out) {
  read_word(f, value, "operation", &operation_from_name, out);
}
void read_custom(FromPython& f, nb::handle value, NanPolicy::Action& out) {
  read_word(f, value, "action", &NanPolicy::action_from_name, out);
}
void read_custom(FromPython& f, nb::handle value, Dropout::Mode& out) {
  read_word(f, value, "mode", &Dropout::mode_from_name, out);
}
void read_custom(FromPython& f, nb::handle value, Draw& out) {
  nb::object kind = nb::getattr(value, "kind", nb::none());
  const std::string name = nb::isinstance<nb::str>(kind) ? nb::cast<std::string>(kind) : "";
  FromPython reader(value);
  out = Draw{};
  if (name == "gaussian") {
    reader("std", out.std);
    reader("mean", out.mean);
  } else if (name == "uniform") {
    out.kind = Draw::Kind::kUniform;
    reader("low", out.low);
    reader("high", out.high);
  } else {
    out.kind = Draw::Kind::kConstant;
    if (name == "constant") {
      reader("value", out.value);
    } else {
      f.read("draw", value, out.value);  // a plain number
    }
  }
}

template <class Fields>
void fields(Fields& f, Noise& c) {
  f("draw", c.draw);
  f("operation", c.operation);
  f("density", c.density);
}
template <class Fields>
void fields(Fields& f, EpisodeBias& c) {
  f("draw", c.draw);
  f("operation", c.operation);
  f("per_component", c.per_component);
}
template <class Fields>
void fields(Fields& f, BiasDrift& c) {
  f("std", c.std);
  f("time_constant_s", c.time_constant_s);
  f("density", c.density);
  f("start_at_zero", c.start_at_zero);
}
template <class Fields>
void fields(Fields& f, Scale& c) {
  f("factor", c.factor);
}
template <class Fields>
void fields(Fields& f, Misalignment& c) {
  f("scale_error", c.scale_error);
  f("angle", c.angle);
  f("scale_error_std", c.scale_error_std);
  f("angle_std", c.angle_std);
}
template <class Fields>
void fields(Fields& f, Clip& c) {
  f("low", c.low);
  f("high", c.high);
}
template <class Fields>
void fields(Fields& f, Quantize& c) {
  f("step", c.step);
}
template <class Fields>
void fields(Fields& f, NanPolicy& c) {
  f("action", c.action);
}
template <class Fields>
void fields(Fields& f, Delay& c) {
  f("delay_s", c.delay_s);
  f("delay_max_s", c.delay_max_s);
  f("jitter_s", c.jitter_s);
  f("interpolate", c.interpolate);
}
template <class Fields>
void fields(Fields& f, StepDelay& c) {
  f("min_lag", c.min_lag);
  f("max_lag", c.max_lag);
  f("per_world", c.per_world);
  f("hold_probability", c.hold_probability);
  f("update_period", c.update_period);
  f("per_world_phase", c.per_world_phase);
}
template <class Fields>
void fields(Fields& f, Rate& c) {
  f("rate_hz", c.rate_hz);
  f("phase_s", c.phase_s);
  f("random_phase", c.random_phase);
}
template <class Fields>
void fields(Fields& f, Dropout& c) {
  f("probability", c.probability);
  f("mode", c.mode);
}

void read_custom(FromPython&, nb::handle value, std::shared_ptr<const Effect>& out) {
  nb::object kind = nb::getattr(value, "kind", nb::none());
  const std::string name = nb::isinstance<nb::str>(kind) ? nb::cast<std::string>(kind) : "";
  FromPython reader(value);
  const auto read = [&](auto effect) {
    fields(reader, *effect);
    reader("fields", effect->fields);
    out = std::move(effect);
  };
  if (name == "noise") return read(std::make_shared<Noise>());
  if (name == "episode_bias") return read(std::make_shared<EpisodeBias>());
  if (name == "bias_drift") return read(std::make_shared<BiasDrift>());
  if (name == "scale") return read(std::make_shared<Scale>());
  if (name == "misalignment") return read(std::make_shared<Misalignment>());
  if (name == "clip") return read(std::make_shared<Clip>());
  if (name == "quantize") return read(std::make_shared<Quantize>());
  if (name == "nan_policy") return read(std::make_shared<NanPolicy>());
  if (name == "delay") return read(std::make_shared<Delay>());
  if (name == "step_delay") return read(std::make_shared<StepDelay>());
  if (name == "rate") return read(std::make_shared<Rate>());
  if (name == "dropout") return read(std::make_shared<Dropout>());
  const std::string text = "not an effect: " + nb::cast<std::string>(nb::repr(value));
  throw nb::type_error(text.c_str());
}

template <class Fields>
void fields(Fields& f, EffectSensorCfg& c) {
  f("name", c.name);
  f("sensor", c.sensor);
  f("effects", c.effects);
  f("fields", c.fields);
  f("history_length", c.history_length);
  f("flatten_history", c.flatten_history);
}

CfgKind effect_kind() { return cfg_kind<EffectSensorCfg>("effect"); }

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
    FromPython reader(config);
    reader("effects", cfg.effects);
    reader("history_length", cfg.history_length);
    reader("flatten_history", cfg.flatten_history);
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
  const auto class_name = [](nb::handle object) {
    return nb::cast<std::string>(object.type().attr("__name__"));
  };
  add_cfg_check("Effect", [class_name](nb::handle config) {
    FromPython reader(config);
    std::shared_ptr<const Effect> effect;
    read_custom(reader, config, effect);
    effect->validate(class_name(config));
  });
  add_cfg_check("Draw", [class_name](nb::handle config) {
    FromPython reader(config);
    Draw draw;
    read_custom(reader, config, draw);
    draw.validate(class_name(config));
  });
  nb::class_<PyChain>(m, "EffectChain", "Effects on rows that come from anywhere.")
      .def(nb::init<nb::handle, int, int, double, std::uint64_t>(), nb::arg("config"),
           nb::arg("size"), nb::arg("num_worlds"), nb::arg("period"), nb::arg("seed"))
      .def("reset", &PyChain::reset, nb::arg("world_ids").none())
      .def("apply", &PyChain::apply, nb::arg("rows"));
}

}  // namespace mjsense::python
