// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <span>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/outcome_details.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/replay/json_text.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

// Runs `read`, with `place` in front of the text of its errors.
void at(const std::string& place, const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& e) {
    throw RuntimeError(fmt::format("{} {}", place, e.what()));
  }
}

// Mean and standard deviation in one pass, accurate for values far from zero (Welford).
struct Accumulator {
  std::int64_t count = 0, nan = 0, infinite = 0;
  double mean = 0, squares = 0;
  double min = std::numeric_limits<double>::infinity(),
         max = -std::numeric_limits<double>::infinity();

  void add(double x) {
    if (!std::isfinite(x)) {
      ++(std::isnan(x) ? nan : infinite);
      return;
    }
    ++count;
    min = std::min(min, x);
    max = std::max(max, x);
    const double before = x - mean;
    mean += before / static_cast<double>(count);
    squares += before * (x - mean);
  }

  void store(StreamStats& stats) const {
    stats.count = count;
    stats.nan = nan;
    stats.infinite = infinite;
    if (count == 0) return;
    stats.mean = mean;
    stats.std = std::sqrt(squares / static_cast<double>(count));
    stats.min = min;
    stats.max = max;
  }
};

struct Stream {
  StreamStats stats;
  Accumulator values;
};

class Inspector {
 public:
  InspectResult run(const std::vector<RecordedFile>& files) {
    for (const RecordedFile& file : files) {
      bytes_ += fs::file_size(file.path);
      add_file(file);
    }
    for (auto& [name, stream] : streams_) {
      stream.values.store(stream.stats);
      result_.streams.push_back(std::move(stream.stats));
    }
    return std::move(result_);
  }

 private:
  void add_file(const RecordedFile& recorded) {
    InspectResult::File entry{recorded.name,
                              static_cast<std::int64_t>(fs::file_size(recorded.path))};
    const hdf5::H5Lock lock;
    const std::string path = recorded.path.string();
    const hdf5::Id file = hdf5::open_file(recorded.path);
    at(path, [&] {
      if (result_.settings.empty()) result_.settings = hdf5::text_attribute(file, "recording");
      for (const std::string& name : trajectory_names(file))
        at(name, [&] { add_trajectory(hdf5::open_group(file, name), name, entry); });
    });
    result_.files.push_back(std::move(entry));
  }

  void add_trajectory(hid_t trajectory, const std::string& trajectory_name,
                      InspectResult::File& entry) {
    ++entry.episodes;
    const std::string outcome = hdf5::text_attribute(trajectory, "outcome");
    if (!outcome.empty())
      entry.outcomes[std::string(record::outcome_without_details(outcome))].push_back(
          trajectory_name);
    hdf5::each_dataset(trajectory, [&](const std::string& name) {
      if (!name.starts_with("obs/sensor_data/"))
        at(name + ":", [&] { add_dataset(trajectory, name, entry); });
    });
    if (!hdf5::exists(trajectory, "obs/sensor_data")) return;
    const hdf5::Id videos = hdf5::open_group(trajectory, "obs/sensor_data");
    for (const std::string& key : hdf5::children(videos))
      at(key, [&] { result_.videos.push_back(read_file_name(videos, key)); });
  }

  void add_dataset(hid_t trajectory, const std::string& name, InspectResult::File& entry) {
    const RowDataset dataset(trajectory, name);
    unpacked_ += dataset.bytes();
    if (hdf5::is_bomb(unpacked_, bytes_))
      throw RuntimeError("the files declare far more data than they contain");
    Stream& stream = stream_of(dataset, name);
    if (dataset.is_json()) {
      dataset.each_text([&](std::int64_t, std::string_view text) {
        parse_json(text,
                   [&](const std::string& path, double x) { value_of(name, path, stream).add(x); });
      });
    } else if (dataset.is_number() && !dataset.scalar()) {
      double last = 0;
      dataset.each_number([&](std::span<const double> values) {
        for (const double x : values) stream.values.add(x);
        if (!values.empty()) last = values.back();
      });
      if (name != "success") return;
      constexpr std::int64_t kMax = std::numeric_limits<int>::max();
      entry.steps = static_cast<int>(std::min(kMax, entry.steps + std::min(kMax, dataset.rows())));
      entry.successes += last != 0;
    }
  }

  Stream& stream_of(const RowDataset& dataset, const std::string& name) {
    Stream& stream = streams_[name];
    if (stream.stats.name.empty()) {
      stream.stats.name = name;
      stream.stats.dtype = dataset.dtype();
      stream.stats.shape = dataset.shape();
      stream.stats.unit = hdf5::text_attribute(dataset.id(), "unit");
      stream.stats.frame = hdf5::text_attribute(dataset.id(), "frame");
      stream.stats.description = hdf5::text_attribute(dataset.id(), "description");
    }
    return stream;
  }

  Accumulator& value_of(const std::string& name, const std::string& key, const Stream& whole) {
    Stream& stream = streams_[name + "/" + key];
    if (stream.stats.name.empty()) {
      stream.stats.name = name + "/" + key;
      stream.stats.dtype = "number";
      stream.stats.unit = whole.stats.unit;
    }
    return stream.values;
  }

  InspectResult result_;
  std::map<std::string, Stream> streams_;
  std::uint64_t bytes_ = 0, unpacked_ = 0;
};

// Serialises the result of the process that reads the file.
std::string to_json(const InspectResult& r) {
  nlohmann::json out{{"videos", r.videos}, {"settings", r.settings}};
  for (const InspectResult::File& f : r.files)
    out["files"].push_back({f.path, f.bytes, f.episodes, f.successes, f.steps, f.outcomes});
  for (const StreamStats& s : r.streams)
    out["streams"].push_back({s.name, s.dtype, s.shape, s.unit, s.frame, s.description, s.count,
                              s.nan, s.infinite, s.mean, s.std, s.min, s.max});
  return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

InspectResult from_json(const std::string& text) {
  const auto in = nlohmann::json::parse(text, nullptr, false);
  if (in.is_discarded()) throw RuntimeError("the process that read the recording returned nothing");
  InspectResult r;
  r.videos = in.at("videos");
  r.settings = in.at("settings");
  for (const auto& f : in.value("files", nlohmann::json::array()))
    r.files.push_back({f.at(0), f.at(1), f.at(2), f.at(3), f.at(4),
                       f.at(5).get<std::map<std::string, std::vector<std::string>>>()});
  // JSON has no infinity, so a standard deviation that overflows is written as null.
  const auto number = [](const nlohmann::json& j) {
    return j.is_number() ? j.get<double>() : std::numeric_limits<double>::quiet_NaN();
  };
  for (const auto& s : in.value("streams", nlohmann::json::array()))
    r.streams.push_back({s.at(0), s.at(1), s.at(2), s.at(3), s.at(4), s.at(5), s.at(6), s.at(7),
                         s.at(8), number(s.at(9)), number(s.at(10)), number(s.at(11)),
                         number(s.at(12))});
  return r;
}

std::string size_text(std::int64_t bytes) {
  if (bytes < 1 << 10) return fmt::format("{} B", bytes);
  if (bytes < 1 << 20) return fmt::format("{:.1f} KiB", static_cast<double>(bytes) / (1 << 10));
  return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1 << 20));
}

std::vector<std::string> split_path(const std::string& path) {
  std::vector<std::string> parts;
  for (std::size_t start = 0; start <= path.size();) {
    const std::size_t end = std::min(path.find('/', start), path.size());
    parts.push_back(path.substr(start, end - start));
    start = end + 1;
  }
  return parts;
}

// "    3 x horizon reached: the object is not lifted (traj_1, traj_4, traj_6)"
std::string outcome_line(const std::string& outcome, const std::vector<std::string>& names) {
  constexpr std::size_t kNames = 6;
  const auto shown = std::span(names).first(std::min(names.size(), kNames));
  return fmt::format("    {} x {} ({}{})\n", names.size(), printable(outcome),
                     fmt::join(shown, ", "), names.size() > kNames ? ", ..." : "");
}

// "    tcp_pose      float32  (T, 7)     0.3268 +- 0.3826   [-0.24, 1.041]   m, wxyz  in world"
std::string line_of(const StreamStats& s, const std::string& name, int indent) {
  constexpr int kNameColumns = 34;
  std::string line = fmt::format("{:{}}{:<{}} {:<8} {:<14}", "", indent, name,
                                 std::max(1, kNameColumns - indent), s.dtype, s.shape);
  if (s.count > 0) {
    const std::string range = fmt::format("[{:.4g}, {:.4g}]", s.min, s.max);
    line += fmt::format(" {:>10.4g} +- {:<10.4g} {:<22}", s.mean, s.std, range);
  }
  if (!s.unit.empty()) line += "  " + s.unit;
  if (!s.frame.empty()) line += "  in " + s.frame;
  const auto share = [&](std::int64_t n, const char* what) {
    const auto all = static_cast<double>(s.count + s.nan + s.infinite);
    if (n > 0) line += fmt::format("  {} {:.0f} %", what, 100.0 * static_cast<double>(n) / all);
  };
  share(s.nan, "NaN");
  share(s.infinite, "infinite");
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace

InspectResult inspect(const fs::path& path) {
  std::uint64_t bytes = 0;
  const std::vector<RecordedFile> files = recorded_files(path);
  if (files.empty() && std::ranges::any_of(recorded_houses(path), record::is_locked))
    throw ValueError(
        fmt::format("'{}' is being recorded: none of its files is published yet", path.string()));
  for (const RecordedFile& file : files)
    bytes += static_cast<std::uint64_t>(
        size_of(open_plain(file.path.parent_path(), file.path.filename().string())));
  InspectResult result = from_json(
      hdf5::in_child(path.string(), bytes, [&] { return to_json(Inspector().run(files)); }));
  for (const fs::path& house : recorded_houses(path))
    if (fs::exists(house / record::kStagingDir))
      result.unfinished.push_back(house.filename().string());
  return result;
}

std::string InspectResult::text() const {
  std::string out;
  for (const File& f : files) {
    out += fmt::format("{}  {}, {}, {}, {}\n", f.path, size_text(f.bytes),
                       counted(f.episodes, "episode"), counted(f.successes, "success"),
                       counted(f.steps, "observation"));
    for (const auto& [outcome, names] : f.outcomes) {
      if (outcome != "success") out += outcome_line(outcome, names);
    }
  }
  out += fmt::format("{}\n", counted(videos.size(), "video"));
  for (const std::string& house : unfinished)
    out += fmt::format("{}: the recording has not ended; mjsense verify says what is missing\n",
                       house);
  out += "\n";

  // Printed as a tree: parts of a name that equal the line above are left blank.
  std::vector<std::string> last;
  for (const StreamStats& s : streams) {
    std::vector<std::string> parts = split_path(s.name);
    std::size_t depth = 0;
    while (depth + 1 < parts.size() && depth < last.size() && parts[depth] == last[depth]) ++depth;
    for (; depth + 1 < parts.size(); ++depth) {
      out += fmt::format("{:{}}{}/\n", "", 2 * depth, parts[depth]);
    }
    out += line_of(s, parts.back(), 2 * static_cast<int>(depth)) + "\n";
    last = std::move(parts);
  }
  return printable_lines(out);
}

std::string InspectResult::json() const {
  nlohmann::json j{{"videos", videos},
                   {"unfinished", unfinished},
                   {"recording", record::parse_description(settings)}};
  if (j["recording"].is_discarded()) j["recording"] = nullptr;
  for (const File& f : files) {
    j["files"].push_back({{"path", f.path},
                          {"bytes", f.bytes},
                          {"episodes", f.episodes},
                          {"successes", f.successes},
                          {"steps", f.steps},
                          {"outcomes", f.outcomes}});
  }
  for (const StreamStats& s : streams) {
    nlohmann::json one{{"name", s.name},   {"dtype", s.dtype}, {"shape", s.shape},
                       {"unit", s.unit},   {"frame", s.frame}, {"description", s.description},
                       {"count", s.count}, {"nan", s.nan},     {"infinite", s.infinite}};
    if (s.count > 0) one.update({{"mean", s.mean}, {"std", s.std}, {"min", s.min}, {"max", s.max}});
    j["streams"].push_back(std::move(one));
  }
  return j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace mjsense::replay
