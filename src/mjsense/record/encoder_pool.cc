// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/encoder_pool.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <thread>

#include "mjsense/core/error.h"
#include "mjsense/core/system/os.h"
#include "mjsense/record/process.h"

namespace mjsense::record {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

constexpr int kDefaultEncoders = 32;
constexpr int kWatchPeriodMs = 250;  // period of the check for hanging encoders
constexpr int kReapPeriodMs = 4;     // polling period while an encoder is exiting

}  // namespace

class EncoderPool::Stream {
 public:
  const VideoStream* video = nullptr;
  std::shared_ptr<const Folder> folder;
  std::string output, spool;  // files in `folder`
  OnDone on_done;
  Child child;
  Fd spool_file;
  bool direct = true;   // has an ffmpeg process from the start
  bool closed = false;  // the producer has called close() or abort()
  bool aborted = false;
  std::string failure;
  // Wall-clock seconds since its ffmpeg last read or wrote something, without the time in which it
  // waited for a CPU.
  double idle_s = 0;
  double waited_s = 0;       // total time in which it waited for a CPU
  std::int64_t written = 0;  // bytes written to its ffmpeg
  std::int64_t seen = 0;     // progress (`written` or moved()) at the last check

  // Ring of frames. Frames [taken, filled) wait for the pool's thread, which has written `offset`
  // bytes of the first one.
  std::vector<std::vector<std::uint8_t>> ring;
  std::uint64_t filled = 0, taken = 0;
  std::size_t offset = 0;

  int sink() const { return direct ? child.in.get() : spool_file.get(); }
  bool has_frames() const { return taken < filled; }
  bool failed() const { return !failure.empty() || aborted; }
};

struct EncoderPool::Impl {
  VideoCfg cfg;
  Fps fps;
  const std::atomic<int>* leave;  // 2 or more: the user wants to stop immediately
  int max_encoders;
  int max_direct;   // encoders for streams that are still open; the others encode spool files
  int max_waiting;  // maximum number of spool files that wait for an encoder

  mutable std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::unique_ptr<Stream>> streams;
  int running = 0;  // ffmpeg processes
  bool stop = false;
  double cpu = 0;
  Fd wake_fd;
  std::thread thread;

  Impl(const VideoCfg& cfg_, const Fps& fps_, int streams_at_once, const std::atomic<int>* leave_)
      : cfg(cfg_), fps(fps_), leave(leave_) {
    max_encoders = cfg.max_encoders > 0 ? cfg.max_encoders : kDefaultEncoders;
    const bool enough = streams_at_once <= max_encoders;
    max_direct = enough ? max_encoders : max_encoders - std::max(1, max_encoders / 4);
    max_waiting = std::max(1, streams_at_once);
    wake_fd = os::make_eventfd();
    if (!wake_fd) {
      throw RuntimeError(fmt::format("cannot create an event fd: {}", std::strerror(errno)));
    }
    thread = std::thread([this] { run(); });
  }

  ~Impl() {
    {
      const std::lock_guard lock(mutex);
      stop = true;
    }
    wake();
    thread.join();
    for (auto& stream : streams) kill_process(stream->child);
  }

  void wake() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake_fd.get(), &one, sizeof one);
  }

  int count(auto&& matches) const {
    return static_cast<int>(
        std::count_if(streams.begin(), streams.end(), [&](const auto& s) { return matches(*s); }));
  }
  int waiting() const {
    return count([](const Stream& s) { return !s.direct && s.closed && s.child.pid < 0; });
  }

  // The pool's thread: writes queued frames, starts encoders on complete spool files and collects
  // processes that have ended.
  void run() {
    sigset_t errors;
    sigemptyset(&errors);
    sigaddset(&errors, SIGPIPE);
    sigaddset(&errors, SIGXFSZ);
    // Without this mask, writing to an encoder that died (EPIPE) or beyond the file size limit
    // (EFBIG) would kill this process with a signal.
    pthread_sigmask(SIG_BLOCK, &errors, nullptr);
    std::vector<pollfd> polled;
    std::vector<Stream*> ready;
    Clock::time_point last = Clock::now();
    while (true) {
      polled.assign(1, {wake_fd.get(), POLLIN, 0});
      ready.assign(1, nullptr);
      bool ending = false, waiting = false;
      {
        const std::lock_guard lock(mutex);
        if (stop) return;
        for (const auto& stream : streams) {
          ending |= stream->child.pid >= 0 && !stream->child.in;
          if (stream->child.log) {
            polled.push_back({stream->child.log.get(), POLLIN, 0});
            ready.push_back(stream.get());
          }
          if (stream->failed() || !stream->has_frames()) continue;
          polled.push_back({stream->sink(), POLLOUT, 0});
          ready.push_back(stream.get());
          waiting = true;
        }
      }
      poll(polled.data(), polled.size(), ending ? kReapPeriodMs : waiting ? kWatchPeriodMs : -1);
      // A pause of this process (Ctrl-Z, a suspended machine) must not count as idle time of an
      // encoder.
      const double elapsed = std::min(seconds_since(last), 1e-3 * 4 * kWatchPeriodMs);
      last = Clock::now();
      std::uint64_t drained;
      while (read(wake_fd.get(), &drained, sizeof drained) > 0) {
      }
      for (std::size_t i = 1; i < polled.size(); ++i) {
        if (polled[i].revents == 0) continue;
        if (polled[i].events == POLLIN) {
          read_log(ready[i]->child);
        } else {
          feed(*ready[i]);
        }
      }
      watch(elapsed);
      look_after();
    }
  }

  // Fails streams whose encoder has made no progress for too long.
  void watch(double elapsed) {
    constexpr double kHurrySeconds = 2;
    const bool hurry = leave && leave->load() >= 2;
    const double maximum = hurry ? std::min(kHurrySeconds, cfg.ffmpeg_timeout) : cfg.ffmpeg_timeout;
    const std::lock_guard lock(mutex);
    for (const auto& stream : streams) {
      const bool ending = stream->child.pid >= 0 && !stream->child.in;
      if (stream->failed() || !(ending || (stream->direct && stream->has_frames()))) {
        stream->idle_s = 0;
        continue;
      }
      const std::int64_t now = ending ? moved(*stream) : stream->written;
      // On an overloaded machine an encoder may get no CPU time; that is not a hang.
      const double waited = os::waited_for_processor(stream->child.pid);
      const double without = std::clamp(waited - stream->waited_s, 0.0, elapsed);
      stream->idle_s = now != stream->seen ? 0 : stream->idle_s + elapsed - without;
      stream->seen = now;
      stream->waited_s = waited;
      if (stream->idle_s < maximum) continue;
      stream->failure = fmt::format("ffmpeg {} for {:g} s and was killed (ffmpeg_timeout)",
                                    ending ? "did not finish" : "accepted no frame", maximum);
      changed.notify_all();
    }
  }

  // Progress of an ffmpeg process whose input is complete: bytes read from its input plus bytes
  // written to its output file.
  static std::int64_t moved(const Stream& stream) {
    const std::int64_t read =
        stream.spool_file ? lseek(stream.spool_file.get(), 0, SEEK_CUR) : stream.written;
    return read + stream.folder->size_of(stream.output);
  }

  // Writes as much as the sink accepts without blocking.
  void feed(Stream& stream) {
    const std::size_t size = stream.video->frame_bytes();
    while (true) {
      const std::uint8_t* frame;
      {
        const std::lock_guard lock(mutex);
        if (stream.failed() || !stream.has_frames()) return;
        frame = stream.ring[stream.taken % stream.ring.size()].data();
      }
      const ssize_t n = write(stream.sink(), frame + stream.offset, size - stream.offset);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      const std::lock_guard lock(mutex);
      if (n < 0) {
        stream.failure = stream.direct ? "ffmpeg stopped reading"
                                       : fmt::format("cannot write '{}': {}",
                                                     stream.folder->display_path(stream.spool),
                                                     std::strerror(errno));
      } else {
        stream.offset += static_cast<std::size_t>(n);
        stream.written += n;
        if (stream.offset < size) continue;
        stream.offset = 0;
        ++stream.taken;
      }
      changed.notify_all();
    }
  }

  void look_after() {
    std::vector<std::pair<OnDone, Result>> done;
    {
      const std::lock_guard lock(mutex);
      for (auto& stream : streams) advance(*stream);
      for (auto& stream : streams) {
        Result result;
        if (!ended(*stream, result)) continue;
        done.emplace_back(std::move(stream->on_done), std::move(result));
        stream.reset();
      }
      std::erase(streams, nullptr);
      if (!done.empty()) changed.notify_all();
    }
    // An encoder has become free: check again for streams that wait for one.
    if (!done.empty()) wake();
    for (auto& [on_done, result] : done) on_done(result);
  }

  // Advances a stream that is complete or has failed.
  void advance(Stream& stream) {
    if (stream.failed()) {
      if (stream.child.pid >= 0) finish(stream, true);
      return;
    }
    if (!stream.closed || stream.has_frames()) return;
    stream.ring.clear();
    if (stream.direct) {
      stream.child.in.reset();  // signals the end of input
    } else if (stream.child.pid < 0 && running < max_encoders) {
      stream.spool_file =
          Fd(openat(stream.folder->fd(), stream.spool.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
      try {
        if (!stream.spool_file)
          throw_file("read", stream.folder->display_path(stream.spool), errno);
        stream.child = start_process(encoder_command(cfg, fps, *stream.video, stream.output),
                                     stream.spool_file, stream.folder->fd(),
                                     encoder_limits(cfg, *stream.video));
        ++running;
      } catch (const Error& error) {
        stream.failure = error.what();
      }
    }
  }

  // Collects an ffmpeg process that has exited; with `now`, kills it if necessary. False if it
  // still runs.
  bool finish(Stream& stream, bool now) {
    Exit exit;
    bool ended = process_ended(stream.child, exit);
    if (!ended && now && !stream.failure.empty()) {
      // It stopped reading and is about to exit: give it time to write its error message.
      usleep(50000);
      ended = process_ended(stream.child, exit);
    }
    if (ended && !exit.ok) stream.failure = "ffmpeg: " + exit.why;
    if (!ended && now) {
      exit = kill_process(stream.child);
      ended = true;
    }
    if (!ended) return false;
    --running;
    cpu += exit.cpu_s;
    stream.child.in.reset();
    return true;
  }

  bool ended(Stream& stream, Result& result) {
    if (!stream.failed()) {
      const bool started = stream.child.pid >= 0;
      // Still receives input, or waits for an encoder.
      if (!started || stream.child.in) return false;
      if (!finish(stream, false)) return false;
    } else if (!stream.closed && !stream.aborted) {
      return false;  // the producer still uses it; reserve() reports the failure
    }
    if (!stream.spool.empty()) stream.folder->remove(stream.spool);
    result = {!stream.failed(), stream.aborted,
              stream.failure.empty()
                  ? ""
                  : fmt::format("video '{}': {}", stream.video->key, stream.failure)};
    return true;
  }
};

EncoderPool::EncoderPool(const VideoCfg& cfg, const Fps& fps, int streams_at_once,
                         const std::atomic<int>* stop)
    : impl_(std::make_unique<Impl>(cfg, fps, streams_at_once, stop)) {}
EncoderPool::~EncoderPool() = default;

EncoderPool::Stream* EncoderPool::open(const VideoStream& video,
                                       std::shared_ptr<const Folder> folder,
                                       const std::string& output, OnDone on_done) {
  auto stream = std::make_unique<Stream>();
  stream->video = &video;
  stream->folder = std::move(folder);
  stream->output = output;
  stream->on_done = std::move(on_done);
  stream->ring.assign(std::max(1, impl_->cfg.queue_frames),
                      std::vector<std::uint8_t>(video.frame_bytes()));

  std::unique_lock lock(impl_->mutex);
  const bool may_spool = impl_->max_direct < impl_->max_encoders;
  const auto slot_free = [&] {
    const int direct = impl_->count([](const Stream& s) { return s.direct; });
    return direct < impl_->max_direct && impl_->running < impl_->max_encoders;
  };
  if (may_spool) {
    impl_->changed.wait(lock, [&] { return impl_->waiting() < impl_->max_waiting; });
  } else {
    impl_->changed.wait(lock, slot_free);
  }
  stream->direct = slot_free();
  if (stream->direct) {
    stream->child = start_process(encoder_command(impl_->cfg, impl_->fps, video, output), true,
                                  false, stream->folder->fd(), encoder_limits(impl_->cfg, video));
    ++impl_->running;
  } else {
    stream->spool = output + ".raw";
    stream->spool_file = Fd(openat(stream->folder->fd(), stream->spool.c_str(),
                                   O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (!stream->spool_file)
      throw_file("write", stream->folder->display_path(stream->spool), errno);
  }
  return impl_->streams.emplace_back(std::move(stream)).get();
}

std::span<std::uint8_t> EncoderPool::reserve(Stream* stream) {
  std::unique_lock lock(impl_->mutex);
  impl_->changed.wait(lock, [&] {
    return stream->failed() || stream->filled - stream->taken < stream->ring.size();
  });
  if (stream->failed()) return {};
  return stream->ring[stream->filled % stream->ring.size()];
}

void EncoderPool::commit(Stream* stream) {
  {
    const std::lock_guard lock(impl_->mutex);
    ++stream->filled;
  }
  impl_->wake();
}

void EncoderPool::close(Stream* stream) {
  {
    const std::lock_guard lock(impl_->mutex);
    stream->closed = true;
  }
  impl_->wake();
}

void EncoderPool::abort(Stream* stream) {
  {
    const std::lock_guard lock(impl_->mutex);
    stream->aborted = true;
  }
  impl_->wake();
}

double EncoderPool::cpu_s() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->cpu;
}

}  // namespace mjsense::record
