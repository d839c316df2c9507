// SPDX-License-Identifier: Apache-2.0
// Fuzz target for recordings. The HDF5 library writes them; the fuzzer's bytes choose types,
// shapes, layouts, links and attributes of everything that is read. Files on which the HDF5 library
// itself fails are tested by the fault suite, where they are read in another process.

#include <fuzzer/FuzzedDataProvider.h>

#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/h5.h"
#include "mjsense/record/staged_episode.h"
#include "mjsense/replay/recording_tools.h"
#include "tests/fuzz/fuzz.h"

namespace fs = std::filesystem;
using namespace mjsense;

namespace {

constexpr const char* kPlaces[] = {"traj_0",
                                   "traj_0/success",
                                   "traj_0/fail",
                                   "traj_0/rewards",
                                   "traj_0/obs",
                                   "traj_0/terminated",
                                   "traj_0/truncated",
                                   "traj_0/obs_scene",
                                   "traj_0/obs/agent",
                                   "traj_0/obs/agent/qpos",
                                   "traj_0/obs/agent/qvel",
                                   "traj_0/obs/extra",
                                   "traj_0/obs/extra/x",
                                   "traj_0/obs/sensor_data",
                                   "traj_0/obs/sensor_data/cam",
                                   "traj_0/obs/sensor_data/cam_depth",
                                   "traj_0/obs/sensor_param",
                                   "traj_0/obs/sensor_param/cam",
                                   "traj_0/actions",
                                   "traj_1",
                                   "traj_1/success",
                                   "traj_x",
                                   "other"};
constexpr const char* kAttributes[] = {"crc32",     "bytes",   "width", "height", "spec",
                                       "encoding",  "outcome", "unit",  "frame",  "description",
                                       "recording", "episode", "seed",  "format", "fps"};
constexpr const char* kTexts[] = {"",
                                  "json",
                                  "rgb",
                                  "success",
                                  "00000000",
                                  "1a2b3c4d",
                                  "cam.mp4",
                                  "../cam.mp4",
                                  "/etc/passwd",
                                  "\x1b[31m",
                                  "\xff\xfe",
                                  "{\"a\": [1, NaN]}",
                                  "{\"batches\":1,\"episodes\":1}",
                                  "[[[[",
                                  "traj_0"};

// Wraps an HDF5 id. Errors are expected here, because the fuzzer makes many invalid requests.
hdf5::Id id(hid_t number, herr_t (*close)(hid_t)) {
  if (number >= 0) return {number, close, "fuzz"};
  H5Eclear2(H5E_DEFAULT);
  return {};
}

class Writer {
 public:
  Writer(FuzzedDataProvider& in, hid_t file) : in_(in), file_(file) {}

  void all() {
    for (int n = 0; n < 60 && in_.remaining_bytes() > 0; ++n) {
      switch (in_.ConsumeIntegralInRange(0, 7)) {
        case 0:
        case 1:
        case 2:
          dataset(place());
          break;
        case 3:
        case 4:
          attribute(place());
          break;
        case 5:
          if (const std::string at = place(); H5Lexists(file_, at.c_str(), H5P_DEFAULT) > 0)
            H5Ldelete(file_, at.c_str(), H5P_DEFAULT);
          break;
        case 6:
          link(place());
          break;
        default:
          group(place());
          break;
      }
      H5Eclear2(H5E_DEFAULT);
    }
  }

 private:
  std::string place() {
    std::string at = in_.PickValueInArray(kPlaces);
    if (in_.ConsumeIntegralInRange(0, 15) == 0) at += "/" + in_.ConsumeRandomLengthString(8);
    return at.c_str();  // truncated at the first NUL
  }
  std::string text() {
    return in_.ConsumeBool() ? in_.PickValueInArray(kTexts) : in_.ConsumeRandomLengthString(40);
  }

  hdf5::Id type() {
    switch (in_.ConsumeIntegralInRange(0, 14)) {
      case 0:
      case 1:
        return id(H5Tcopy(H5T_STD_U8LE), H5Tclose);
      case 2:
        return hdf5::memory_type(DType::kBool);
      case 3:
        return id(H5Tcopy(H5T_IEEE_F32LE), H5Tclose);
      case 4:
        return id(H5Tcopy(H5T_STD_I64BE), H5Tclose);
      case 5:
        return hdf5::text_type();
      case 6: {
        hdf5::Id fixed = id(H5Tcopy(H5T_C_S1), H5Tclose);
        H5Tset_size(fixed, in_.ConsumeIntegralInRange<std::size_t>(1, 5000));
        return fixed;
      }
      case 7: {
        hdf5::Id enumeration =
            id(H5Tenum_create(in_.ConsumeBool() ? H5T_STD_I8LE : H5T_STD_I64LE), H5Tclose);
        const std::int64_t values[] = {0, 1};
        H5Tenum_insert(enumeration, "FALSE", &values[0]);
        if (in_.ConsumeBool()) H5Tenum_insert(enumeration, "TRUE", &values[1]);
        return enumeration;
      }
      case 8: {
        hdf5::Id compound = id(H5Tcreate(H5T_COMPOUND, 24), H5Tclose);
        H5Tinsert(compound, "a", 0, H5T_STD_I64LE);
        if (in_.ConsumeBool()) H5Tinsert(compound, "b", 8, hdf5::text_type());
        return compound;
      }
      case 9:
        return id(H5Tcreate(H5T_OPAQUE, in_.ConsumeIntegralInRange<std::size_t>(1, 100)), H5Tclose);
      case 10: {
        const hsize_t dims[] = {in_.ConsumeIntegralInRange<hsize_t>(1, 9), 2};
        return id(H5Tarray_create2(H5T_STD_U8LE, 2, dims), H5Tclose);
      }
      case 11:
        return id(H5Tvlen_create(H5T_STD_U8LE), H5Tclose);
      case 12:
        return id(H5Tcopy(in_.ConsumeBool() ? H5T_STD_REF_OBJ : H5T_STD_REF_DSETREG), H5Tclose);
      case 13: {
        hdf5::Id odd = id(H5Tcopy(in_.ConsumeBool() ? H5T_STD_I64LE : H5T_IEEE_F64LE), H5Tclose);
        H5Tset_precision(odd, in_.ConsumeIntegralInRange<std::size_t>(1, 64));
        return odd;
      }
      default:
        return id(H5Tcopy(H5T_STD_B16LE), H5Tclose);
    }
  }

  hdf5::Id space(bool& simple) {
    simple = false;
    switch (in_.ConsumeIntegralInRange(0, 7)) {
      case 0:
        return id(H5Screate(H5S_NULL), H5Sclose);
      case 1:
        return id(H5Screate(H5S_SCALAR), H5Sclose);
      default:
        break;
    }
    simple = true;
    hsize_t dims[4];
    const int rank = in_.ConsumeIntegralInRange(1, 4);
    for (int i = 0; i < rank; ++i) {
      dims[i] = in_.ConsumeIntegralInRange(0, 15) == 0
                    ? in_.ConsumeIntegralInRange<hsize_t>(0, hsize_t{1} << 60)
                    : in_.PickValueInArray<hsize_t>({0, 1, 2, 3, 100, 1000});
    }
    return id(H5Screate_simple(rank, dims, nullptr), H5Sclose);
  }

  hdf5::Id layout(int rank) {
    hdf5::Id properties = id(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    const int kind = in_.ConsumeIntegralInRange(0, 9);
    if (kind == 0) H5Pset_layout(properties, H5D_COMPACT);
    if (kind == 1) H5Pset_external(properties, "/etc/passwd", 0, H5F_UNLIMITED);
    if (kind < 5 || rank == 0) return properties;
    hsize_t chunk[4];
    for (int i = 0; i < rank; ++i)
      chunk[i] = in_.ConsumeIntegralInRange(0, 15) == 0
                     ? in_.ConsumeIntegralInRange<hsize_t>(1, 1u << 31)
                     : in_.PickValueInArray<hsize_t>({1, 2, 100, 1000});
    H5Pset_chunk(properties, rank, chunk);
    if (in_.ConsumeBool()) H5Pset_deflate(properties, 1);
    if (in_.ConsumeIntegralInRange(0, 7) == 0) H5Pset_shuffle(properties);
    if (in_.ConsumeIntegralInRange(0, 7) == 0) H5Pset_fletcher32(properties);
    if (in_.ConsumeIntegralInRange(0, 7) == 0)  // lzf, which our own code decodes
      H5Pset_filter(properties, 32000, H5Z_FLAG_OPTIONAL, 0, nullptr);
    return properties;
  }

  void dataset(const std::string& at) {
    bool simple = false;
    const hdf5::Id of = type(), in = space(simple);
    if (!of.valid() || !in.valid()) return;
    const int rank = simple ? H5Sget_simple_extent_ndims(in) : 0;
    const hdf5::Id properties = layout(rank);
    if (H5Lexists(file_, at.c_str(), H5P_DEFAULT) > 0) H5Ldelete(file_, at.c_str(), H5P_DEFAULT);
    const hdf5::Id made =
        id(H5Dcreate2(file_, at.c_str(), of, in, hdf5::link_properties(), properties, H5P_DEFAULT),
           H5Dclose);
    const hssize_t count = H5Sget_simple_extent_npoints(in);
    if (!made.valid() || count <= 0) return;
    if (H5Pget_layout(properties) == H5D_CHUNKED && in_.ConsumeBool()) {
      // Writes a chunk of arbitrary bytes that bypasses the filters.
      const std::string bytes = in_.ConsumeRandomLengthString(300);
      const hsize_t origin[4] = {};
      H5Dwrite_chunk(made, H5P_DEFAULT, 0, origin, bytes.size(), bytes.data());
      return;
    }
    if (H5Tdetect_class(of, H5T_VLEN) > 0 || H5Tdetect_class(of, H5T_REFERENCE) > 0 ||
        H5Tget_class(of) == H5T_COMPOUND || H5Tis_variable_str(of) > 0) {
      if (count != 1 || H5Tis_variable_str(of) <= 0) return;
      const std::string value = text();
      const char* pointer = value.c_str();
      H5Dwrite(made, of, H5S_ALL, H5S_ALL, H5P_DEFAULT, &pointer);
      return;
    }
    const std::size_t element = H5Tget_size(of);
    if (static_cast<std::size_t>(count) > (1u << 16) / element) return;
    std::string bytes = in_.ConsumeBool() ? text() : in_.ConsumeRandomLengthString(200);
    bytes.resize(element * static_cast<std::size_t>(count));
    H5Dwrite(made, of, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  }

  void attribute(const std::string& at) {
    const hdf5::Id object =
        at.empty() ? hdf5::Id() : id(H5Oopen(file_, at.c_str(), H5P_DEFAULT), H5Oclose);
    const hid_t of = object.valid() && in_.ConsumeIntegralInRange(0, 7) != 0
                         ? static_cast<hid_t>(object)
                         : file_;
    const char* name = in_.PickValueInArray(kAttributes);
    H5Adelete(of, name);
    if (in_.ConsumeBool()) return hdf5::set_attribute(of, name, std::string_view(text()));
    bool simple = false;
    const hdf5::Id what = type(), in = space(simple);
    if (!what.valid() || !in.valid()) return;
    const hdf5::Id made = id(H5Acreate2(of, name, what, in, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    const hssize_t count = H5Sget_simple_extent_npoints(in);
    if (!made.valid() || count <= 0 || count > 4000 || H5Tdetect_class(what, H5T_VLEN) > 0 ||
        H5Tdetect_class(what, H5T_REFERENCE) > 0 || H5Tis_variable_str(what) > 0 ||
        H5Tget_class(what) == H5T_COMPOUND)
      return;
    std::string bytes = in_.ConsumeRandomLengthString(64);
    bytes.resize(H5Tget_size(what) * static_cast<std::size_t>(count));
    H5Awrite(made, what, bytes.data());
  }

  void link(const std::string& at) {
    const std::string to = "/" + std::string(in_.PickValueInArray(kPlaces));
    const hdf5::Id properties = hdf5::link_properties();
    switch (in_.ConsumeIntegralInRange(0, 2)) {
      case 0:
        H5Lcreate_soft(to.c_str(), file_, at.c_str(), properties, H5P_DEFAULT);
        break;
      case 1:
        H5Lcreate_external("/etc/passwd", to.c_str(), file_, at.c_str(), properties, H5P_DEFAULT);
        break;
      default:
        H5Lcreate_hard(file_, to.c_str(), file_, at.c_str(), properties, H5P_DEFAULT);
        break;
    }
  }

  void group(const std::string& at) {
    id(H5Gcreate2(file_, at.c_str(), hdf5::link_properties(), H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  }

  FuzzedDataProvider& in_;
  hid_t file_;
};

// Writes a valid recording, which the fuzzer's bytes then change.
void write_sound(hid_t file) {
  hdf5::set_attribute(file, "recording", std::string_view(R"({"batches":1,"episodes":1})"));
  const auto rows = [&](const char* at, hid_t type, std::vector<hsize_t> dims, const void* data) {
    const hdf5::Id space =
        id(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose);
    const hdf5::Id made =
        id(H5Dcreate2(file, at, type, space, hdf5::link_properties(), H5P_DEFAULT, H5P_DEFAULT),
           H5Dclose);
    H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
  };
  const hdf5::Id boolean = hdf5::memory_type(DType::kBool);
  const std::int8_t no[] = {0, 0, 0}, yes[] = {1, 1, 1};
  const float numbers[3 * 7] = {1, 2, 3};
  for (const char* name : {"success", "terminated", "truncated"})
    rows((std::string("traj_0/") + name).c_str(), boolean, {3}, no);
  rows("traj_0/fail", boolean, {3}, yes);
  rows("traj_0/rewards", H5T_IEEE_F32LE, {3}, numbers);
  rows("traj_0/obs/agent/qpos", H5T_IEEE_F32LE, {3, 7}, numbers);
  std::string text(3 * 1000, '\0');
  for (int t = 0; t < 3; ++t) text.replace(1000 * t, 16, R"({"a": [1, 2, 3]})");
  rows("traj_0/obs/agent/qvel", H5T_STD_U8LE, {3, 1000}, text.data());
  std::string name = "cam.mp4";
  name.resize(100);
  rows("traj_0/obs/sensor_data/cam", H5T_STD_U8LE, {100}, name.data());
  hdf5::write_text(file, "traj_0/obs_scene", "{}");
}

// A folder with one file, in memory if the machine has a file system in memory.
const fs::path& house() {
  static const fs::path folder = [] {
    const char* base = fs::is_directory("/dev/shm") ? "/dev/shm" : "/tmp";
    std::string name = std::string(base) + "/mjsense_fuzz_XXXXXX";
    if (!mkdtemp(name.data())) std::abort();
    std::ofstream(name + "/cam.mp4") << "no video";
    static std::string kept = name;
    std::atexit([] { fs::remove_all(kept); });
    return fs::path(name);
  }();
  return folder;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzedDataProvider in(data, size);
  const fs::path path = house() / "trajectories_batch_1_of_1.h5";
  const bool staged = in.ConsumeBool();
  const fs::path file = staged ? house() / "episode/traj.h5" : path;
  try {
    const hdf5::H5Lock lock;
    fs::create_directories(file.parent_path());
    const hdf5::Id made = hdf5::create_file(file);
    if (in.ConsumeIntegralInRange(0, 7) != 0) write_sound(made);
    Writer(in, made).all();
  } catch (const Error&) {
    // Continue with the part that was written.
  }
  try {
    if (staged) {
      static_cast<void>(record::read_staged(record::Folder::open(file.parent_path())));
    } else {
      const replay::VerifyResult found =
          replay::verify(path, {.decode = false, .ffmpeg = "/bin/false"});
      if (found.text().find('\x1b') != std::string::npos)
        fuzz::broken("no control characters reach a terminal", found.text());
      static_cast<void>(replay::inspect(path).text());
    }
  } catch (const Error&) {
  }
  return 0;
}
