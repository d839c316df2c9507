// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/file_verifier.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/replay/description_checks.h"
#include "mjsense/replay/json_text.h"

namespace mjsense::replay {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kMaxSteps = 10'000'000;  // per episode: a week at 15 Hz
constexpr std::size_t kMaxFindings = 200;       // per file

class FileVerifier {
 public:
  FileVerifier(const RecordedFile& recorded, std::uint64_t bytes, bool sealed)
      : recorded_(recorded), bytes_(bytes), sealed_(sealed) {}

  std::string run() {
    try {
      check_file();
    } catch (const Error& e) {
      error(recorded_.name, e.what());
    }
    out_["episodes"] = episodes_;
    out_["steps"] = steps_;
    return out_.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

 private:
  void add(bool is_error, const std::string& context, const std::string& text) {
    if (++findings_ == kMaxFindings)
      return out_["findings"].push_back(
          {is_error, recorded_.name, "has further findings, which are not listed"});
    if (findings_ < kMaxFindings)
      out_["findings"].push_back({is_error, printable(context), printable(text)});
  }
  void error(const std::string& context, const std::string& text) { add(true, context, text); }
  void note(const std::string& context, const std::string& text) { add(false, context, text); }

  void check_file() {
    const hdf5::H5Lock lock;
    const hdf5::Id file = hdf5::open_file(recorded_.path);
    haddr_t end = 0;
    if (!sealed_ && H5Fget_eoa(file, &end) >= 0 && end < bytes_)
      error(recorded_.name, fmt::format("has {} bytes after its end", bytes_ - end));
    ours_ = hdf5::has_attribute(file, "recording");
    if (ours_) check_description(hdf5::text_attribute(file, "recording"));
    const std::vector<std::string> names = trajectory_names(file);
    if (names.empty()) error(recorded_.name, "contains no trajectory");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string context = recorded_.name + " " + names[i];
      if (names[i] != fmt::format("traj_{}", i)) {
        error(recorded_.name,
              fmt::format("trajectory {} is named '{}', expected 'traj_{}'", i, names[i], i));
      }
      try {
        check_trajectory(hdf5::open_group(file, names[i]), context);
      } catch (const Error& e) {
        error(context, e.what());
      }
    }
    if (ours_ && without_sum_ > 0) {
      note(recorded_.name,
           fmt::format("has no checksums of {} datasets and videos: {}", without_sum_,
                       with_sum_ > 0 ? "they were changed or added later"
                                     : "recorded by a version that stored none"));
    } else if (ours_ && !sealed_) {
      note(recorded_.name,
           "was changed since it was recorded: it has no checksum of the whole file");
    }
  }

  void check_description(const std::string& text) {
    const Json description = record::parse_description(text);
    if (!description.is_object())
      return error(recorded_.name, "has a description of the recording that cannot be read");
    for (const std::string& wrong : description_faults(description))
      error(recorded_.name, "has a description of the recording " + wrong);
    listed_ = listed_places(description);
    if (!description.contains("streams"))
      note(recorded_.name, "does not list its streams, so missing ones are not noticed");
    const auto archive = description.find("model_archive");
    if (archive == description.end()) return;
    if (archive->is_string()) out_["archive"] = *archive;
  }

  // A stream that the description lists is in the file.
  void check_listed(hid_t trajectory, const std::string& context) {
    for (const ListedStream& stream : listed_) {
      const bool there = std::ranges::any_of(
          stream.places, [&](const std::string& place) { return hdf5::exists(trajectory, place); });
      if (!there)
        error(context, fmt::format("has no '{}': the stream '{}' was recorded", stream.places[0],
                                   stream.name));
    }
  }

  void check_trajectory(hid_t trajectory, const std::string& context) {
    ++episodes_;
    if (!hdf5::exists(trajectory, "success"))
      return error(context, "has no 'success': its length is unknown");
    const RowDataset success(trajectory, "success");
    if (!success.is_number() || success.row_size() != 1)
      return error(context, "has a 'success' that is not a one-dimensional array of booleans");
    const std::int64_t T = success.rows();
    if (T > kMaxSteps) return error(context, fmt::format("declares {} steps", T));
    steps_ += T;
    if (T == 0) error(context, "has no steps");
    for (const char* name : {"rewards", "fail", "terminated", "truncated", "obs_scene"}) {
      if (!hdf5::exists(trajectory, name)) error(context, fmt::format("has no '{}'", name));
    }
    check_listed(trajectory, context);
    hdf5::each_dataset(trajectory, [&](const std::string& name) {
      if (name.starts_with("obs/sensor_data/")) return;
      try {
        check_dataset(trajectory, name, T, context + "/" + name);
      } catch (const Error& e) {
        error(context + "/" + name, e.what());
      }
    });
    check_success(trajectory, context);
    for (const char* name : {"obs/agent/qpos", "obs/agent/qvel"}) {
      if (!hdf5::exists(trajectory, name))
        note(context, fmt::format("has no '{}', which MolmoSpaces' tools require", name));
    }
    check_sensor_data(trajectory, T, context);
  }

  // Compares with the checksum stored in the object's attribute.
  void compare(hid_t object, const std::string& context, const record::Checksum& sum) {
    const std::string stated = hdf5::text_attribute(object, record::kChecksumAttribute);
    ++(stated.empty() ? without_sum_ : with_sum_);
    if (!stated.empty() && stated != sum.text())
      error(context, fmt::format("differs from what was recorded: its checksum is {}, expected {}",
                                 sum.text(), stated));
  }

  void check_dataset(hid_t trajectory, const std::string& name, std::int64_t T,
                     const std::string& context) {
    const RowDataset dataset(trajectory, name);
    unpacked_ += dataset.bytes();
    if (hdf5::is_bomb(unpacked_, bytes_))
      return error(context, "is not read: the file declares far more data than it contains");
    for (const char* attribute :
         {"unit", "frame", "description"})  // throws for one that is not a text
      static_cast<void>(hdf5::text_attribute(dataset.id(), attribute));
    record::Checksum sum;
    if (name == "obs_scene") {
      const std::string text = hdf5::read_text(trajectory, name);
      bool finite = true;
      const auto number = [&](const std::string&, double x) {
        finite = finite && std::isfinite(x);
      };
      if (const auto wrong = parse_json(text, number); !wrong.empty())
        error(context, "is not JSON text: " + wrong);
      else if (ours_ && !finite)
        error(context, "has NaN or an infinite number, which is never recorded");
      sum.add(text.data(), text.size());
      return compare(dataset.id(), context, sum);
    }
    const bool every_step =
        !name.starts_with("replay/model/") && name != "replay/held" && name != "replay/changed";
    if (every_step && (dataset.scalar() || dataset.rows() != T)) {
      return error(context, fmt::format("has {}, expected {}",
                                        counted(dataset.scalar() ? 0 : dataset.rows(), "row"), T));
    }
    if (dataset.is_json()) {
      int bad = 0;
      dataset.each_text([&](std::int64_t t, std::string_view text) {
        const std::string wrong = parse_json(text);
        if (!wrong.empty() && bad++ == 0)
          error(context, fmt::format("row {} is not JSON text: {}", t, wrong));
      });
      if (bad > 1) error(context, fmt::format("{} rows are not JSON text", bad));
    }
    if (!dataset.is_number()) {
      if (ours_) error(context, fmt::format("is {}, which is never recorded", dataset.dtype()));
      return;
    }
    dataset.each_bytes([&](std::string_view bytes) { sum.add(bytes.data(), bytes.size()); });
    compare(dataset.id(), context, sum);
    if (ours_ && dataset.dtype().starts_with("float")) check_nan(dataset, context);
  }

  // A stream may hold NaN if its description says what that means.
  void check_nan(const RowDataset& dataset, const std::string& context) {
    if (hdf5::text_attribute(dataset.id(), "description").find("NaN") != std::string::npos) return;
    std::int64_t at = 0, first = -1, count = 0;
    dataset.each_number([&](std::span<const double> values) {
      for (const double x : values) {
        if (std::isnan(x) && count++ == 0) first = at;
        ++at;
      }
    });
    if (count > 0) {
      error(context, fmt::format("holds {} NaN, the first in row {}, and its description does not "
                                 "say what NaN means",
                                 count, first / dataset.row_size()));
    }
  }

  void check_success(hid_t trajectory, const std::string& context) {
    if (!hdf5::exists(trajectory, "fail")) return;
    std::vector<std::int8_t> success, fail;
    const auto read = [&](const char* name, std::vector<std::int8_t>& out) {
      const RowDataset dataset(trajectory, name);
      if (!dataset.is_number())
        return error(context + "/" + name, fmt::format("is {}, expected bool", dataset.dtype()));
      if (dataset.rows() > kMaxSteps || dataset.row_size() != 1) return;
      dataset.each_number([&](auto v) {
        for (const double x : v) out.push_back(x == 0 ? 0 : x == 1 ? 1 : 2);
      });
    };
    read("success", success);
    read("fail", fail);
    for (std::size_t t = 0; t < std::min(success.size(), fail.size()); ++t) {
      if (success[t] + fail[t] != 1)
        return error(context + "/fail", fmt::format("row {} is not the opposite of success", t));
    }
  }

  void check_sensor_data(hid_t trajectory, std::int64_t T, const std::string& context) {
    std::set<std::string> named;
    if (hdf5::exists(trajectory, "obs/sensor_data")) {
      const hdf5::Id group = hdf5::open_group(trajectory, "obs/sensor_data");
      for (const std::string& key : hdf5::children(group)) {
        named.insert(key);
        const std::string video_place = fmt::format("{}/obs/sensor_data/{}", context, key);
        try {
          const hdf5::Id dataset = hdf5::open_dataset(group, key);
          const std::string crc = hdf5::text_attribute(dataset, record::kChecksumAttribute);
          ++(crc.empty() ? without_sum_ : with_sum_);
          out_["videos"].push_back({{"place", printable(video_place)},
                                    {"name", read_file_name(group, key)},
                                    {"frames", T},
                                    {"width", hdf5::int_attribute(dataset, "width", 0)},
                                    {"height", hdf5::int_attribute(dataset, "height", 0)},
                                    {"crc", crc}});
        } catch (const Error& e) {
          error(video_place, e.what());
        }
      }
    }
    if (!hdf5::text_attribute(trajectory, "outcome").empty() ||
        !hdf5::exists(trajectory, "obs/sensor_param"))
      return;
    for (const std::string& camera :
         hdf5::children(hdf5::open_group(trajectory, "obs/sensor_param"))) {
      if (!named.contains(camera))
        note(context, fmt::format("names no video of camera '{}' (repair adds the names)", camera));
    }
  }

  const RecordedFile& recorded_;
  std::uint64_t bytes_;
  bool sealed_;
  Json out_{{"findings", Json::array()}, {"videos", Json::array()}};
  std::size_t findings_ = 0;
  bool ours_ = false;
  std::vector<ListedStream> listed_;  // by the description of the recording
  int episodes_ = 0, without_sum_ = 0, with_sum_ = 0;
  std::int64_t steps_ = 0;
  std::uint64_t unpacked_ = 0;
};

}  // namespace

std::string verify_file(const RecordedFile& recorded, std::uint64_t bytes, bool sealed) {
  return FileVerifier(recorded, bytes, sealed).run();
}

}  // namespace mjsense::replay
