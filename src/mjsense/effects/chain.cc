// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/chain.h"

#include <fmt/format.h>

#include <cstring>

#include "mjsense/core/error.h"
#include "mjsense/effects/all_effects.h"

namespace mjsense::effects {

namespace {

std::string context_of(const Effects& effects, std::size_t i, std::string_view context) {
  return fmt::format("{}, effect {} ({})", context, i, effects[i]->kind());
}

}  // namespace

void validate(const Effects& effects, std::string_view context) {
  for (std::size_t i = 0; i < effects.size(); ++i) {
    if (!effects[i]) throw ValueError(fmt::format("{}: effect {} is null", context, i));
    check_effect(effects[i], context_of(effects, i, context));
  }
}

EffectChain::EffectChain(std::string name, const SensorSpec& input, const EffectChainCfg& cfg,
                         int num_worlds, double tick_s, double period)
    : spec_(input),
      dtype_(input.dtype),
      size_(static_cast<int>(input.shape.size())),
      history_(cfg.history_length),
      tick_s_(tick_s),
      worlds_(num_worlds) {
  if (cfg.history_length < 0) {
    throw ValueError(fmt::format("sensor '{}': history_length is {}: must not be negative", name,
                                 cfg.history_length));
  }
  const std::string context = fmt::format("sensor '{}'", name);
  validate(cfg.effects, context);
  for (std::size_t i = 0; i < cfg.effects.size(); ++i) {
    EffectInit init;
    init.context = context_of(cfg.effects, i, context);
    init.num_worlds = num_worlds;
    init.dtype = dtype_;
    init.size = size_;
    init.period = period;
    init.stream = stream_of(fmt::format("{}#{}", name, i));
    effects_.push_back(cfg.effects[i]->clone());
    effects_.back()->initialize(init);
    needs_every_step_ |= effects_.back()->needs_every_step();
  }
  if (history_ > 0) {
    needs_every_step_ = true;
    spec_.shape = cfg.flatten_history ? Shape{static_cast<std::int64_t>(history_) * size_}
                                      : input.shape.with_front(history_);
    spec_.description += fmt::format(" The last {} values, oldest first.", history_);
  }
}

EffectTime EffectChain::moment_of(const ChainTick& t) const {
  const WorldState& state = worlds_[t.world];
  EffectTime m;
  m.world = t.world;
  m.key = t.key;
  m.seed = t.seed;
  m.tick = t.tick;
  m.episode = t.episode;
  m.time = static_cast<double>(t.tick) * tick_s_;
  m.advance = state.fresh || t.tick != state.tick;
  m.first = state.fresh || (state.first && !m.advance);
  m.elapsed = state.fresh ? 0.0 : static_cast<double>(t.tick - state.tick) * tick_s_;
  return m;
}

void EffectChain::reset(const ChainTick& tick) {
  worlds_[tick.world].fresh = true;
  const EffectTime moment = moment_of(tick);
  for (auto& effect : effects_) effect->reset(moment);
}

void EffectChain::apply(const ChainTick& tick, std::span<const std::byte> in,
                        std::span<std::byte> out) {
  const EffectTime moment = moment_of(tick);
  const std::size_t bytes = in.size();
  std::byte* newest = out.data() + out.size() - bytes;
  if (history_ > 0 && moment.advance && !moment.first) {
    std::memmove(out.data(), out.data() + bytes, out.size() - bytes);
  }
  std::memcpy(newest, in.data(), bytes);
  const EffectRow row{newest, dtype_, size_};
  for (auto& effect : effects_) effect->apply(moment, row);
  if (moment.first) {
    for (std::byte* frame = out.data(); frame != newest; frame += bytes) {
      std::memcpy(frame, newest, bytes);
    }
  }
  worlds_[tick.world] = {tick.tick, false, moment.first};
}

}  // namespace mjsense::effects
