// SPDX-License-Identifier: Apache-2.0
#pragma once
// The HDF5 C API with owners, errors as exceptions, and the file properties that make the same data
// the same bytes. The serial library is not thread-safe: hold an H5Lock around everything here.

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/file_limit.h"

namespace mjsense::h5 {

class H5Lock {
 public:
  H5Lock();
  // For the child of a fork, where nobody else is: the mutex still belongs to a thread of its parent.
  static void alone();

 private:
  FileLimitIsError limit_;  // the library writes whenever it likes
  std::unique_lock<std::recursive_mutex> lock_;
};

// An HDF5 identifier and the function that closes it.
class Id {
 public:
  Id() = default;
  // `what`: for the error thrown when `id` is negative.
  Id(hid_t id, herr_t (*close)(hid_t), std::string_view what);
  ~Id() { reset(); }
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Id& operator=(Id&& other) noexcept;
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;

  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }
  void reset();
  void close(std::string_view what);  // throws when closing fails: for files, that is when buffers
                                      // reach the disk

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

// Throws RuntimeError "what: <what HDF5 says>" if `status` is negative.
void check(herr_t status, std::string_view what);

// In the place of a file that is there; a link is replaced, not followed. `shown`: what messages call
// it, where that is not its path.
Id create_file(const std::filesystem::path& path, std::string_view shown = "");
Id open_file(const std::filesystem::path& path, bool writable = false, std::string_view shown = "");
Id create_group(hid_t parent,
                const std::string& path);  // and the groups above it; an existing one is opened
Id group_properties();                     // creation properties: no time stamps
Id dataset_properties();
Id link_properties();  // creates missing groups, names in UTF-8

Id memory_type(DType dtype);  // bool: the enum {FALSE, TRUE} of int8, which h5py reads as bool
Id text_type();               // variable-length UTF-8

// Every part of the path; false where one is a link to elsewhere.
bool exists(hid_t parent, const std::string& path);
// Names, sorted by code point. Throws RuntimeError beyond 100,000.
std::vector<std::string> children(hid_t group);
std::vector<hsize_t> dims(hid_t dataset);

Id write_text(hid_t parent, const std::string& path, std::string_view text);  // a scalar dataset
// One text of variable or fixed length, at most 16 MiB; RuntimeError for anything else.
std::string read_text(hid_t parent, const std::string& path);

void set_attribute(hid_t object, const char* name, std::string_view value);
void set_attribute(hid_t object, const char* name, double value);
void set_attribute(hid_t object, const char* name, std::int64_t value);
void set_attribute(hid_t object, const char* name, std::uint64_t value);
// A text whose words come later: made with the others of its object, it costs a third less.
Id create_text_attribute(hid_t object, const char* name);
void write_text_attribute(hid_t attribute, std::string_view value);
bool has_attribute(hid_t object, const char* name);
// Of one text, "" if absent; of one number, `otherwise` if absent. RuntimeError for anything else.
std::string text_attribute(hid_t object, const char* name);
std::int64_t int_attribute(hid_t object, const char* name, std::int64_t otherwise);
double double_attribute(hid_t object, const char* name, double otherwise);

}  // namespace mjsense::h5
