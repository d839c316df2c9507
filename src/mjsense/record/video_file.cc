// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/video_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace mjsense::record {
namespace {

constexpr std::uint64_t kMaxTableBytes = 1 << 26;
constexpr int kMaxElements = 10'000'000;

struct Unreadable {
  const char* why;
};

// A file with random access.
class File {
 public:
  explicit File(int fd) : fd_(fd) {
    struct stat about = {};
    if (fstat(fd, &about) == 0) size_ = static_cast<std::uint64_t>(about.st_size);
  }
  std::uint64_t size() const { return size_; }

  // Reads fewer bytes at the end of the file.
  std::size_t read(std::uint64_t at, std::span<std::uint8_t> out) const {
    std::size_t done = 0;
    while (done < out.size() && at + done < size_) {
      const ssize_t n =
          pread(fd_, out.data() + done, out.size() - done, static_cast<off_t>(at + done));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      done += static_cast<std::size_t>(n);
    }
    return done;
  }

 private:
  int fd_;
  std::uint64_t size_ = 0;
};

std::uint64_t big_endian(std::span<const std::uint8_t> bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t b : bytes) value = value << 8 | b;
  return value;
}

// ---- MP4: boxes with a size, a four-letter type and contents

using Bytes = std::span<const std::uint8_t>;

Bytes part(Bytes bytes, std::size_t at, std::size_t count) {
  if (at > bytes.size() || count > bytes.size() - at) throw Unreadable{"a table is truncated"};
  return bytes.subspan(at, count);
}

std::uint64_t number(Bytes bytes, std::size_t at, std::size_t count) {
  return big_endian(part(bytes, at, count));
}

// Calls visit(type, contents) for each box of `bytes`.
template <class Visit>
void each_box(Bytes bytes, Visit&& visit) {
  while (bytes.size() >= 8) {
    std::uint64_t size = number(bytes, 0, 4), header = 8;
    if (size == 1) {
      size = number(bytes, 8, 8);
      header = 16;
    } else if (size == 0) {
      size = bytes.size();
    }
    if (size < header || size > bytes.size())
      throw Unreadable{"a box extends past the end of the file"};
    const std::string_view letters(reinterpret_cast<const char*>(bytes.data()) + 4, 4);
    visit(letters, bytes.subspan(header, size - header));
    bytes = bytes.subspan(size);
  }
}

std::optional<Bytes> find_box(Bytes bytes, std::string_view path) {
  const std::string_view letters = path.substr(0, 4);
  std::optional<Bytes> found;
  each_box(bytes, [&](std::string_view name, Bytes content) {
    if (name == letters && !found) found = content;
  });
  if (!found || path.size() == 4) return found;
  return find_box(*found, path.substr(5));
}

void read_samples(Bytes table, std::uint64_t media_bytes, VideoFacts& facts) {
  const std::uint64_t each = number(table, 4, 4), count = number(table, 8, 4);
  std::uint64_t total = each * count;
  if (each == 0) {
    const Bytes sizes = part(table, 12, count * 4);
    for (std::size_t i = 0; i < count; ++i) total += number(sizes, 4 * i, 4);
  }
  if (total > media_bytes) throw Unreadable{"its frames extend past the end of the file"};
  facts.frames = static_cast<std::int64_t>(count);
}

VideoFacts read_mp4(const File& file) {
  VideoFacts facts;
  std::vector<std::uint8_t> tables;
  std::uint64_t media_bytes = 0;
  int boxes = 0;
  for (std::uint64_t at = 0; at < file.size();) {
    std::uint8_t head[16] = {};
    const std::size_t got = file.read(at, head);
    if (got < 8 || ++boxes > kMaxElements) throw Unreadable{"its last box is truncated"};
    std::uint64_t size = big_endian({head, 4}), header = 8;
    if (size == 1 && got == 16) {
      size = big_endian({head + 8, 8});
      header = 16;
    } else if (size == 0) {
      size = file.size() - at;
    }
    if (size < header || size > file.size() - at)
      throw Unreadable{"a box extends past the end of the file: the file is truncated"};
    const std::string_view letters(reinterpret_cast<const char*>(head) + 4, 4);
    if (letters == "mdat") media_bytes += size - header;
    if (letters == "moof") throw Unreadable{"it is fragmented"};
    if (letters == "moov") {
      if (size > kMaxTableBytes) throw Unreadable{"its tables are longer than 64 MiB"};
      tables.resize(size - header);
      if (file.read(at + header, tables) != tables.size())
        throw Unreadable{"its tables are truncated"};
    }
    at += size;
  }
  if (tables.empty()) throw Unreadable{"it has no tables (moov)"};
  bool found = false;
  each_box(tables, [&](std::string_view name, Bytes track) {
    if (name != "trak" || found) return;
    const auto handler = find_box(track, "mdia/hdlr");
    if (!handler || number(*handler, 8, 4) != 0x76696465) return;  // "vide"
    const auto samples = find_box(track, "mdia/minf/stbl/stsz"),
               forms = find_box(track, "mdia/minf/stbl/stsd");
    if (!samples || !forms) throw Unreadable{"its video has no tables"};
    found = true;
    const Bytes letters = part(*forms, 8 + 4, 4);
    facts.codec.assign(letters.begin(), letters.end());
    if (facts.codec == "avc1" || facts.codec == "avc3") facts.codec = "h264";
    facts.width = static_cast<int>(number(*forms, 8 + 32, 2));
    facts.height = static_cast<int>(number(*forms, 8 + 34, 2));
    read_samples(*samples, media_bytes, facts);
  });
  if (!found) throw Unreadable{"it contains no video"};
  return facts;
}

// ---- Matroska: elements with an id, a size and contents

constexpr std::uint64_t kHeader = 0x1A45DFA3, kSegment = 0x18538067, kTracks = 0x1654AE6B,
                        kTrack = 0xAE, kTrackNumber = 0xD7, kTrackType = 0x83, kVideo = 0xE0,
                        kCodec = 0x86, kCodecPrivate = 0x63A2, kWidth = 0xB0, kHeight = 0xBA,
                        kCluster = 0x1F43B675, kSimpleBlock = 0xA3, kBlockGroup = 0xA0,
                        kBlock = 0xA1;

class Matroska {
 public:
  explicit Matroska(const File& file) : file_(file) {}

  VideoFacts read() {
    each(0, file_.size(), [&](const Element& e) {
      if (e.id != kSegment) return;
      each(e.begin, e.end, [&](const Element& child) {
        if (child.id == kTracks) read_tracks(child);
        if (child.id == kCluster) read_cluster(child);
      });
    });
    if (track_ == 0) throw Unreadable{"it contains no video"};
    return facts_;
  }

 private:
  struct Element {
    std::uint64_t id, begin, end;
  };

  // Reads an integer of 1 to 8 bytes, whose first byte encodes its length, and advances `at`.
  std::uint64_t variable(std::span<const std::uint8_t> bytes, std::size_t& at, bool marker) const {
    if (at >= bytes.size() || bytes[at] == 0) throw Unreadable{"an element is malformed"};
    std::size_t size = 1;
    while (!(bytes[at] & (0x80 >> (size - 1)))) ++size;
    if (size > bytes.size() - at) throw Unreadable{"an element is truncated"};
    std::uint64_t value = big_endian(bytes.subspan(at, size));
    if (!marker) value &= ~(0x80ULL << (8 * (size - 1) - (size - 1)));
    at += size;
    if (!marker && value == (1ULL << (7 * size)) - 1) return kUnknown;
    return value;
  }

  template <class Visit>
  void each(std::uint64_t begin, std::uint64_t end, Visit&& visit) {
    while (begin < end) {
      if (++elements_ > kMaxElements) throw Unreadable{"it has too many elements"};
      std::uint8_t head[16];
      const std::size_t got = file_.read(
          begin, {head, static_cast<std::size_t>(std::min<std::uint64_t>(16, end - begin))});
      std::size_t at = 0;
      const std::uint64_t id = variable({head, got}, at, true);
      const std::uint64_t size = variable({head, got}, at, false);
      const std::uint64_t first = begin + at;
      if (size == kUnknown && id != kSegment) throw Unreadable{"it was streamed"};
      if (size != kUnknown && size > end - first)
        throw Unreadable{"an element extends past the end of the file: the file is truncated"};
      const std::uint64_t last = size == kUnknown ? end : first + size;
      visit(Element{id, first, last});
      begin = last;
    }
  }

  std::uint64_t integer(const Element& e) const {
    std::uint8_t bytes[8] = {};
    const std::uint64_t size = e.end - e.begin;
    if (size > 8) throw Unreadable{"a number is too long"};
    const std::size_t count = file_.read(e.begin, {bytes, static_cast<std::size_t>(size)});
    return big_endian({bytes, count});
  }

  // The first bytes of an element, as text.
  std::string text(const Element& e) const {
    constexpr std::uint64_t kMaxBytes = 64;
    std::string bytes(static_cast<std::size_t>(std::min(e.end - e.begin, kMaxBytes)), '\0');
    bytes.resize(
        file_.read(e.begin, {reinterpret_cast<std::uint8_t*>(bytes.data()), bytes.size()}));
    return bytes;
  }

  // "V_MS/VFW/FOURCC" stores its four letters in a BITMAPINFOHEADER.
  static std::string codec_of(std::string id, const std::string& description) {
    constexpr std::size_t kLetters = 16;
    id.resize(std::min(id.size(), id.find('\0')));
    if (id == "V_MS/VFW/FOURCC" && description.size() >= kLetters + 4)
      id = description.substr(kLetters, 4);
    if (id == "V_FFV1" || id == "FFV1") return "ffv1";
    return id == "V_MPEG4/ISO/AVC" ? "h264" : id;
  }

  void read_tracks(const Element& tracks) {
    each(tracks.begin, tracks.end, [&](const Element& track) {
      if (track.id != kTrack || track_ != 0) return;
      std::uint64_t number = 0, type = 0, width = 0, height = 0;
      std::string codec, description;
      each(track.begin, track.end, [&](const Element& e) {
        if (e.id == kTrackNumber) number = integer(e);
        if (e.id == kTrackType) type = integer(e);
        if (e.id == kCodec) codec = text(e);
        if (e.id == kCodecPrivate) description = text(e);
        if (e.id != kVideo) return;
        each(e.begin, e.end, [&](const Element& v) {
          if (v.id == kWidth) width = integer(v);
          if (v.id == kHeight) height = integer(v);
        });
      });
      constexpr std::uint64_t kVideoTrack = 1, kMaxPixels = 1 << 16;
      if (type != kVideoTrack) return;
      if (number == 0 || width > kMaxPixels || height > kMaxPixels)
        throw Unreadable{"its video has no tables"};
      track_ = number;
      facts_.codec = codec_of(codec, description);
      facts_.width = static_cast<int>(width);
      facts_.height = static_cast<int>(height);
    });
  }

  void read_cluster(const Element& cluster) {
    each(cluster.begin, cluster.end, [&](const Element& e) {
      if (e.id == kSimpleBlock) count_block(e);
      if (e.id != kBlockGroup) return;
      each(e.begin, e.end, [&](const Element& inner) {
        if (inner.id == kBlock) count_block(inner);
      });
    });
  }

  void count_block(const Element& e) {
    std::uint8_t head[8];
    const std::size_t maximum = std::min<std::uint64_t>(8, e.end - e.begin);
    const std::size_t got = file_.read(e.begin, {head, maximum});
    std::size_t at = 0;
    if (variable({head, got}, at, false) == track_) ++facts_.frames;
  }

  static constexpr std::uint64_t kUnknown = std::numeric_limits<std::uint64_t>::max();
  const File& file_;
  VideoFacts facts_;
  std::uint64_t track_ = 0;
  int elements_ = 0;
};

}  // namespace

VideoFacts read_video_facts(int fd) {
  const File file(fd);
  std::uint8_t head[8] = {};
  const std::size_t got = file.read(0, head);
  try {
    if (got == 0) throw Unreadable{"it is empty"};
    const auto in = [](const char* container, VideoFacts facts) {
      facts.container = container;
      return facts;
    };
    if (got >= 4 && big_endian({head, 4}) == kHeader) return in("Matroska", Matroska(file).read());
    if (got == 8 && big_endian({head + 4, 4}) == 0x66747970)  // "ftyp"
      return in("MP4", read_mp4(file));
    throw Unreadable{"it is neither MP4 nor Matroska"};
  } catch (const Unreadable& e) {
    VideoFacts facts;
    facts.error = e.why;
    return facts;
  }
}

}  // namespace mjsense::record
