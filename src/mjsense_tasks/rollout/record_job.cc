// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/record_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/rng.h"
#include "mjsense/record/model_fields.h"
#include "mjsense/record/outcome_details.h"
#include "mjsense/record/sha256.h"
#include "mjsense/scene/model_archive.h"
#include "mjsense_tasks/rollout/recording_settings.h"
#include "mjsense_tasks/rollout/registry.h"

namespace mjsense::tasks::rollout {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

record::RecordingCfg recording_cfg(const RecordJobCfg& job, Rollout& rollout,
                                   const StopFlag* stop) {
  record::RecordingCfg cfg;
  static_cast<record::FilesCfg&>(cfg) = job;
  cfg.out_dir = job.out;
  cfg.num_attempts = job.num_attempts;
  cfg.first_attempt = job.first_attempt;
  cfg.attempts.assign(job.attempts.begin(), job.attempts.end());
  cfg.num_worlds = rollout.num_worlds();
  cfg.videos = job.videos;
  cfg.fps = record::Fps::from_period_ms(rollout.task().cfg().policy_dt_ms);
  for (const auto& sensor : rollout.suite().sensors()) cfg.sensors.push_back(sensor.get());
  if (const Sensor* replay = rollout.replay_sensor()) {
    cfg.sensors.push_back(replay);
    cfg.archive = scene::model_archive(rollout.simulation().scene());
    record::Sha256 sum;
    sum.add(cfg.archive.data(), cfg.archive.size());
    cfg.archive_name = record::archive_name(sum.text());
  }
  cfg.settings = recording_settings(job, rollout);
  cfg.model = rollout.task().model();
  cfg.stop = stop;
  return cfg;
}

class RecordJob {
 public:
  RecordJob(const RecordJobCfg& cfg, const StopFlag* stop)
      : cfg_(checked(cfg)),
        rollout_(rollout_cfg(cfg_)),
        recorder_(recording_cfg(cfg_, rollout_, stop)),
        lengths_(rollout_.num_worlds(), 0),
        begun_(rollout_.num_worlds()),
        end_(cfg_.num_attempts > 0   ? cfg_.num_attempts
             : cfg_.max_attempts > 0 ? cfg_.max_attempts
                                     : 6 * std::int64_t{cfg_.episodes}) {
    if (!cfg_.videos) return;
    for (const RecordedCamera& camera : rollout_.cameras()) pictures_ += camera.depth ? 2 : 1;
  }

  RecordSummary run(const std::function<void(const RecordProgress&)>& report,
                    const StopFlag* stop) {
    const auto begun = Clock::now();
    double reported = -1;
    while (true) {
      const int level = stop ? stop->load() : 0;
      if (level >= 2) abandon();
      const bool started = level == 0 && start_episodes();
      if (running_ == 0 && started) continue;  // all of them ended at their first observation
      if (running_ == 0) break;
      rollout_.act();
      rollout_.step();
      for (int w = 0; w < rollout_.num_worlds(); ++w) {
        if (rollout_.active(w)) observe(w);
      }
      progress_.seconds = since(begun);
      update_progress();
      if (report && progress_.seconds - reported > 0.1) {
        report(progress_);
        reported = progress_.seconds;
      }
    }
    summary_.interrupted = stop && stop->load() > 0 && !has_all();
    timed([&] { summary_.interrupted ? recorder_.flush() : recorder_.complete(); });
    progress_.seconds = since(begun);
    update_progress();
    if (report) report(progress_);
    summary_.enough = cfg_.num_attempts > 0 ? has_all() : recorder_.kept() >= cfg_.episodes;
    summary_.progress = progress_;
    summary_.times = rollout_.times();
    summary_.record = recorder_.stats();
    summary_.house_dir = recorder_.house_dir();
    summary_.damage = recorder_.damage();
    return summary_;
  }

 private:
  // Limits the number of worlds to that of the episodes and replaces the robot by its own name, by
  // which recordings identify it.
  static RecordJobCfg checked(RecordJobCfg cfg) {
    check_fields(cfg, "");
    if (!cfg.rollout.use_sensors)
      throw ValueError("record needs the sensors: use_sensors must be true");
    if (cfg.rollout.policy.empty() && !cfg.rollout.make_policy) {
      throw ValueError(fmt::format("record needs a policy{}", suggest("", policy_names())));
    }
    if (!cfg.attempts.empty()) cfg = with_attempts(std::move(cfg));
    cfg = without_shard(std::move(cfg));
    if (cfg.num_attempts > 0 && (cfg.episodes != 1 || cfg.max_attempts > 0)) {
      throw ValueError(
          "num_attempts is the number of attempts, whatever their outcome: leave out episodes and "
          "max_attempts");
    }
    if (cfg.num_attempts > 0) cfg.episodes = cfg.num_attempts;
    cfg.rollout.num_worlds = std::min(cfg.rollout.num_worlds, cfg.episodes);
    cfg.rollout = resolved(std::move(cfg.rollout));
    cfg.rollout.replay_sensor = cfg.replay;
    return cfg;
  }

  static RecordJobCfg with_attempts(RecordJobCfg cfg) {
    if (cfg.num_attempts > 0 || cfg.first_attempt > 0 || cfg.append) {
      throw ValueError(
          "attempts excludes num_attempts, first_attempt, append and shard: it lists all attempts");
    }
    for (std::size_t k = 0; k < cfg.attempts.size(); ++k) {
      const int before = k == 0 ? -1 : cfg.attempts[k - 1];
      if (cfg.attempts[k] <= before) {
        throw ValueError(fmt::format("attempts: {} follows {}: the numbers start at 0 and ascend",
                                     cfg.attempts[k], k == 0 ? "nothing" : std::to_string(before)));
      }
    }
    cfg.first_attempt = cfg.attempts.front();
    cfg.num_attempts = static_cast<int>(cfg.attempts.size());
    return cfg;
  }

  std::int64_t attempt(std::int64_t position) const {
    return cfg_.attempts.empty() ? recorder_.first_attempt() + position : cfg_.attempts[position];
  }

  static RolloutCfg rollout_cfg(const RecordJobCfg& cfg) {
    RolloutCfg rollout = cfg.rollout;
    // With given starts, what is not given is that of the stated seed.
    if (rollout.starts.empty()) rollout.seed = seed_of_house(rollout.seed, cfg.house);
    return rollout;
  }

  bool has_all() const {
    return cfg_.num_attempts > 0 ? recorder_.kept() + recorder_.discarded() >= cfg_.num_attempts
                                 : recorder_.has_all_episodes();
  }

  template <class Body>
  void timed(Body&& body) {
    const auto begun = Clock::now();
    body();
    summary_.recording_s += since(begun);
  }

  // Starts the next attempts in free worlds, as many as are needed if all running ones succeed.
  // Returns false if none was started.
  bool start_episodes() {
    worlds_.clear();
    episodes_.clear();
    for (int w = 0; w < rollout_.num_worlds(); ++w) {
      if (rollout_.active(w)) continue;
      while (next_ < end_ && recorder_.decided(attempt(next_))) ++next_;
      if (next_ >= end_ || recorder_.kept() + running_ >= cfg_.episodes) break;
      worlds_.push_back(w);
      episodes_.push_back(attempt(next_++));
      ++running_;
    }
    if (worlds_.empty()) return false;
    rollout_.start(worlds_, episodes_);
    for (std::size_t k = 0; k < worlds_.size(); ++k) {
      if (rollout_.replay_sensor()) begun_[worlds_[k]] = own_values(worlds_[k]);
      timed([&] {
        recorder_.begin_episode(worlds_[k], {.episode = episodes_[k], .seed = rollout_.cfg().seed});
      });
      lengths_[worlds_[k]] = 0;
      observe(worlds_[k]);
    }
    return true;
  }

  // Records the current observation of world w and ends its episode if it is over.
  void observe(int w) {
    if (!rollout_.fault(w).empty()) return end(w, false, rollout_.fault(w));
    const episode::Evaluation& now = rollout_.evaluation(w);
    timed([&] {
      recorder_.append(w, {.reward = static_cast<float>(now.reward),
                           .terminated = now.terminal,
                           .truncated = now.truncated,
                           .success = now.success});
    });
    progress_.frames += pictures_;
    if (++lengths_[w] > 1) ++progress_.steps;
    if (!now.terminal && !now.truncated) return;
    end(w, now.success, outcome(w, now));
  }

  // Outcome of an attempt: "horizon reached: the object is not lifted", "the policy gave up: found
  // no way (256 grasps: 200 out of reach; ...)".
  std::string outcome(int w, const episode::Evaluation& now) {
    if (now.success) return "success";
    const robots::Action* last = rollout_.task().last_action(w);
    const bool gave_up = now.terminal && last && last->success == false;
    const char* what = gave_up        ? "the policy gave up"
                       : now.terminal ? "no success"
                                      : "horizon reached";
    const episode::Policy* policy = rollout_.policy();
    std::string why = gave_up && policy ? policy->failure(w) : std::string(now.missing);
    if (now.missing == kTooDeep) why = fmt::format("{} ({})", kTooDeep, rollout_.deep_contact(w));
    return why.empty() ? what : fmt::format("{}: {}", what, why);
  }

  void end(int w, bool success, const std::string& outcome) {
    timed([&] {
      if (success || (cfg_.keep_failures && lengths_[w] > 1 && !rollout_.refused(w))) {
        recorder_.finish_episode(w, rollout_.obs_scene(w), outcome, replay_arrays(w));
      } else {
        recorder_.discard_episode(w, outcome);
      }
    });
    // The steps of failed attempts count towards the cost of a kept episode.
    ended_steps_ += std::max(0, lengths_[w] - 1);
    ++(success ? progress_.succeeded : progress_.failed);
    progress_.mean_length = static_cast<double>(ended_steps_) /
                            std::max(1, cfg_.keep_failures ? progress_.succeeded + progress_.failed
                                                           : progress_.succeeded);
    if (!success) ++summary_.failures[std::string(record::outcome_without_details(outcome))];
    summary_.lengths.push_back(lengths_[w]);
    rollout_.stop(w);
    --running_;
  }

  // The values of the model that differ between worlds.
  std::vector<record::EpisodeArray> own_values(int w) {
    sim::Simulation& simulation = rollout_.simulation();
    return record::differing_fields(simulation.model_of(w), *simulation.model());
  }

  // The fields of the model that were written during the episode of world w, "opt.wind geom_rgba".
  std::string changed_fields(int w) {
    const std::vector<record::EpisodeArray> now = own_values(w);
    std::string names;
    const auto missing = [&](const record::EpisodeArray& array,
                             const std::vector<record::EpisodeArray>& others) {
      return std::ranges::none_of(others, [&](const record::EpisodeArray& other) {
        return other.path == array.path && other.values == array.values;
      });
    };
    const auto add = [&](const record::EpisodeArray& array) {
      const std::string name = array.path.substr(std::string_view("model/").size());
      if ((" " + names + " ").find(" " + name + " ") == std::string::npos)
        names += (names.empty() ? "" : " ") + name;
    };
    for (const record::EpisodeArray& array : now) {
      if (missing(array, begun_[w])) add(array);
    }
    for (const record::EpisodeArray& array : begun_[w]) {
      if (missing(array, now)) add(array);
    }
    return names;
  }

  // Data for replay that does not depend on the step: the model's arrays of world w that differ from
  // the archived model, the names of those that were written during the episode, and the free joints
  // of absent objects, which are held at rest.
  std::vector<record::EpisodeArray> replay_arrays(int w) {
    if (!rollout_.replay_sensor()) return {};
    sim::Simulation& simulation = rollout_.simulation();
    std::vector<record::EpisodeArray> arrays =
        record::differing_fields(simulation.model_of(w), *rollout_.task().model());
    if (const std::string changed = changed_fields(w); !changed.empty()) {
      const auto text = std::as_bytes(std::span(changed));
      arrays.push_back({"changed",
                        "Fields of the model that were written during the episode, which therefore "
                        "cannot be simulated again. model/ has the values at its end.",
                        "",
                        "",
                        DType::kUint8,
                        {static_cast<std::int64_t>(changed.size())},
                        {text.begin(), text.end()}});
    }
    const std::vector<int> held = simulation.worlds().held(w);
    const auto bytes = std::as_bytes(std::span(held));
    if (!held.empty())
      arrays.push_back({"held",
                        "Ids of the free joints of absent objects, which are held at rest.",
                        "",
                        "",
                        DType::kInt32,
                        {static_cast<std::int64_t>(held.size())},
                        {bytes.begin(), bytes.end()}});
    return arrays;
  }

  void abandon() {
    for (int w = 0; w < rollout_.num_worlds(); ++w) {
      if (!rollout_.active(w)) continue;
      recorder_.abandon_episode(w);
      rollout_.stop(w);
      --running_;
    }
  }

  void update_progress() {
    progress_.kept = recorder_.saved();
    progress_.wanted = cfg_.episodes - (cfg_.num_attempts > 0 ? recorder_.discarded() : 0);
    progress_.running = running_;
    progress_.running_steps = 0;
    for (int w = 0; w < rollout_.num_worlds(); ++w) {
      if (rollout_.active(w)) progress_.running_steps += lengths_[w] - 1;
    }
    progress_.physics_steps = progress_.steps * rollout_.task().decimation();
  }

  RecordJobCfg cfg_;
  Rollout rollout_;
  record::Recorder recorder_;
  RecordProgress progress_;
  RecordSummary summary_;
  std::vector<int> lengths_;  // observations recorded of each world's current episode
  std::vector<std::vector<record::EpisodeArray>> begun_;  // own_values() at the beginning, by world
  std::vector<int> worlds_;
  std::vector<std::int64_t> episodes_;
  std::int64_t next_ = 0, end_;  // positions of the next attempt, and after the last
  std::int64_t ended_steps_ = 0;
  int running_ = 0;
  int pictures_ = 0;  // images per observation
};

}  // namespace

RecordJobCfg without_shard(RecordJobCfg job) {
  constexpr int kMaximum = std::numeric_limits<int>::max();
  if (job.num_attempts > kMaximum - job.first_attempt) {
    throw ValueError(fmt::format("first_attempt + num_attempts is {}, the maximum is {}",
                                 std::int64_t{job.first_attempt} + job.num_attempts, kMaximum));
  }
  if (job.shard.empty()) return job;
  if (!job.attempts.empty()) throw ValueError("shard and attempts exclude each other");
  std::int64_t k = -1, n = 0;
  const char *first = job.shard.data(), *last = first + job.shard.size();
  const auto [slash, k_error] = std::from_chars(first, last, k);
  const auto [end, n_error] = slash < last && *slash == '/'
                                  ? std::from_chars(slash + 1, last, n)
                                  : std::from_chars_result{slash, std::errc::invalid_argument};
  if (k_error != std::errc{} || n_error != std::errc{} || end != last || k < 0 || k >= n) {
    throw ValueError(
        fmt::format("shard is '{}', expected k/n with k from 0 to n - 1, such as 0/8", job.shard));
  }
  const std::int64_t total = job.num_attempts;
  if (total < n) {
    throw ValueError(fmt::format(
        "shard '{}': num_attempts is {}; it is the number of attempts of all shards, at least {}",
        job.shard, total, n));
  }
  if (job.append)
    throw ValueError("shard and append exclude each other: use first_attempt for new attempts");
  const auto begin_of = [&](std::int64_t i) {
    return static_cast<int>(total / n * i + std::min(i, total % n));
  };
  job.first_attempt += begin_of(k);
  job.num_attempts = begin_of(k + 1) - begin_of(k);
  job.out /= fmt::format("shard_{}", k);
  job.shard.clear();
  return job;
}

std::uint64_t seed_of_house(std::uint64_t seed, int house) {
  if (house == 0) return seed;
  return Rng(seed, static_cast<std::uint32_t>(house), stream_of("house"), 0).next64();
}

double RecordProgress::seconds_left() const {
  if (mean_length == 0 || steps == 0) return std::numeric_limits<double>::quiet_NaN();
  const double steps_left = (wanted - kept) * mean_length - static_cast<double>(running_steps);
  return std::max(0.0, steps_left) * seconds / static_cast<double>(steps);
}

RecordSummary record_episodes(const RecordJobCfg& cfg,
                              const std::function<void(const RecordProgress&)>& progress,
                              const StopFlag* stop) {
  return RecordJob(cfg, stop).run(progress, stop);
}

}  // namespace mjsense::tasks::rollout
