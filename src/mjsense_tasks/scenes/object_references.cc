// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_references.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/scenes/colour_words.h"

namespace mjsense::tasks::scenes {
namespace {

// An object differs in size if its longest edge and its volume are larger by these factors.
constexpr double kLonger = 1.15, kBulkier = 1.3;
constexpr double kApart = 0.06;   // m, minimum distance along a direction that is named
constexpr double kSlope = 0.6;    // maximum distance across it, as a share of that along it
constexpr double kClose = 0.35;   // m, maximum distance of an object that is mentioned
constexpr double kNext = 0.18;    // m, maximum distance of objects next to each other
constexpr double kNotNext = 0.3;  // m, minimum distance of objects that are not
constexpr double kLevel = 0.08;   // m, maximum difference in height
constexpr double kEdge = 0.02, kAbove = 0.25;  // m, of an object that stands on a surface
constexpr std::array<double, 4> kWeights{0.3, 0.25, 0.3, 0.15};
constexpr std::array<std::string_view, 12> kMaterials{"wooden", "metal",     "plastic", "ceramic",
                                                      "glass",  "cardboard", "paper",   "wax",
                                                      "rubber", "tin",       "steel",   "foam"};

// A present object as an observer describes it.
struct Seen {
  int index;
  std::vector<std::string> names;
  Vec3 at;  // middle, in the robot's frame
  double edge = 0, volume = 0;
  ColourWords colour;
  std::string material;
};

bool has_word(std::string_view name, std::string_view word) {
  const std::size_t at = name.find(word);
  return at != name.npos && (at == 0 || name[at - 1] == ' ') &&
         (at + word.size() == name.size() || name[at + word.size()] == ' ');
}

// Whether the colours that the name mentions may be those of the object.
bool is_true(std::string_view name, const ColourWords& colour) {
  for (std::size_t i = 0; i < kColourWords.size(); ++i) {
    if (has_word(name, kColourWords[i]) && (colour.may_be >> i & 1u) == 0) return false;
  }
  return true;
}

std::vector<Seen> present_objects(const World& world, const EpisodeScene& scene,
                                  const Pose& robot) {
  const Pose to_robot = inverse(robot);
  std::vector<Seen> all;
  for (int i = 0; i < static_cast<int>(scene.objects().size()); ++i) {
    if (!scene.present(world.id, i)) continue;
    const SceneObject& object = scene.objects()[i];
    const Aabb box = aabb_of(scene.shape(world.id, i).points);
    const Pose pose = body_pose(world.data, object.body);
    const Vec3 size = box.size();
    Seen one{.index = i,
             .names = object.others,
             .at = to_robot * (pose * box.center()),
             .edge = std::max({size.x, size.y, size.z}),
             .volume = size.x * size.y * size.z,
             .colour = colour_words(world.model, object.body),
             .material = object.material};
    one.names.insert(one.names.begin(), object.text);
    all.push_back(std::move(one));
  }
  return all;
}

// Phrases about one object of `all`.
class Describer {
 public:
  // `place`: the text between a noun and its place, " " or " that is ".
  Describer(std::vector<Seen> all, int object, const char* place)
      : all_(std::move(all)), place_(place) {
    for (Seen& one : all_) {
      if (one.index == object) it_ = &one;
    }
  }

  References describe(const World& world, const EpisodeScene& scene, const Pose& robot,
                      std::span<const int> other_objects, bool far) {
    if (it_ == nullptr) return {};
    std::vector<std::string> nouns;
    for (const std::string& name : it_->names) {
      if (is_true(name, it_->colour)) nouns.push_back(name);
    }
    for (const std::string& noun : nouns) {
      const std::vector<const Seen*> rivals = rivals_of(noun);
      if (rivals.empty()) add(0, noun);
      attributes(noun, rivals);
      surfaces(noun, rivals, world, scene, robot);
      if (far) continue;
      relations(noun, rivals, other_objects);
      extremes(noun, rivals);
    }
    return std::move(found_);
  }

 private:
  using Rivals = std::vector<const Seen*>;

  void add(int kind, const std::string& phrase) {
    const std::string text = "the " + phrase;
    if (std::ranges::find(found_[kind], text) == found_[kind].end()) found_[kind].push_back(text);
  }
  // Other objects for which the noun may be used.
  Rivals rivals_of(std::string_view noun, const Seen* of = nullptr) const {
    Rivals rivals;
    for (const Seen& one : all_) {
      const auto fits = [&](const std::string& name) { return may_be_called(name, noun); };
      if (&one != (of ? of : it_) && std::ranges::any_of(one.names, fits)) rivals.push_back(&one);
    }
    return rivals;
  }

  void attributes(const std::string& noun, const Rivals& rivals) {
    // "salt" names what is in a "salt shaker": there is no glass or larger salt.
    const std::string& name = it_->names[0];
    if (name.starts_with(noun + " ") && !name.starts_with(noun + " of ")) return;
    const auto has = [&](std::string_view word) { return has_word(noun, word); };
    const int is = it_->colour.is;
    if (is >= 0 && std::ranges::none_of(kColourWords, has) &&
        std::ranges::none_of(rivals, [&](auto* r) { return (r->colour.may_be >> is & 1u) != 0; }))
      add(1, fmt::format("{} {}", kColourWords[is], noun));
    if (!it_->material.empty() && std::ranges::none_of(kMaterials, has) &&
        std::ranges::none_of(kColourWords, has) && std::ranges::none_of(rivals, [&](auto* r) {
          return r->material.empty() || r->material == it_->material;
        }))
      add(1, fmt::format("{} {}", it_->material, noun));
    if (rivals.empty()) return;
    const auto is_larger = [](const Seen& a, const Seen& b) {
      return a.edge > kLonger * b.edge && a.volume > kBulkier * b.volume;
    };
    const bool two = rivals.size() == 1;
    if (std::ranges::all_of(rivals, [&](auto* r) { return is_larger(*it_, *r); })) {
      add(1, (two ? "larger " : "largest ") + noun);
      add(1, (two ? "bigger " : "biggest ") + noun);
    }
    if (std::ranges::all_of(rivals, [&](auto* r) { return is_larger(*r, *it_); }))
      add(1, (two ? "smaller " : "smallest ") + noun);
  }

  // Places relative to other objects. `sense` turns a displacement in the robot's frame such that
  // the direction is x.
  void relations(const std::string& noun, const Rivals& rivals,
                 std::span<const int> other_objects) {
    struct Direction {
      const char* text;
      double x, y;
    };
    constexpr std::array<Direction, 4> kDirections{Direction{"to the left of", 0, 1},
                                                   {"to the right of", 0, -1},
                                                   {"in front of", -1, 0},
                                                   {"behind", 1, 0}};
    for (const Seen& mark : all_) {
      if (&mark == it_ || std::ranges::find(other_objects, mark.index) != other_objects.end())
        continue;
      const std::string& name = mark.names[0];
      if (!is_true(name, mark.colour) || !rivals_of(name, &mark).empty()) continue;
      const auto from_mark = [&](const Seen& one) { return one.at - mark.at; };
      const Vec3 d = from_mark(*it_);
      const double away = std::hypot(d.x, d.y);
      if (away > kClose || std::abs(d.z) > kLevel) continue;
      for (const Direction& to : kDirections) {
        const auto along = [&](Vec3 v) { return to.x * v.x + to.y * v.y; };
        const double across = std::abs(to.y * d.x - to.x * d.y);
        if (along(d) < kApart || across > kSlope * along(d)) continue;
        if (std::ranges::any_of(rivals, [&](auto* r) { return along(from_mark(*r)) > 0; }))
          continue;
        add(2, fmt::format("{}{}{} the {}", noun, place_, to.text, name));
      }
      if (away <= kNext && std::ranges::all_of(rivals, [&](auto* r) {
            const Vec3 v = from_mark(*r);
            return r == &mark || std::hypot(v.x, v.y) > kNotNext;
          }))
        add(2, fmt::format("{}{}next to the {}", noun, place_, name));
    }
  }

  void surfaces(const std::string& noun, const Rivals& rivals, const World& world,
                const EpisodeScene& scene, const Pose& robot) {
    const std::vector<Region> regions = scene.regions_of(world.id);
    const std::vector<SceneRegionCfg>& named = scene.cfg().regions;
    for (std::size_t i = 0; i < regions.size(); ++i) {
      if (named[i].text.empty() ||
          std::ranges::count(named, named[i].text, &SceneRegionCfg::text) > 1)
        continue;
      const Region& region = regions[i];
      const auto on = [&](const Seen& one) {
        const Vec3 p = robot * one.at;
        return p.x > region.area.x0 - kEdge && p.x < region.area.x1 + kEdge &&
               p.y > region.area.y0 - kEdge && p.y < region.area.y1 + kEdge &&
               p.z > region.height && p.z < region.height + kAbove;
      };
      if (on(*it_) && std::ranges::none_of(rivals, [&](auto* r) { return on(*r); }))
        add(2, fmt::format("{}{}on the {}", noun, place_, named[i].text));
    }
  }

  void extremes(const std::string& noun, const Rivals& rivals) {
    if (rivals.empty()) return;
    const auto most = [&](const std::function<double(const Seen&)>& value) {
      return std::ranges::all_of(rivals, [&](auto* r) { return value(*it_) > value(*r) + kApart; });
    };
    const auto distance = [](const Seen& one) { return std::hypot(one.at.x, one.at.y); };
    const bool two = rivals.size() == 1;
    if (most([](const Seen& one) { return one.at.y; }))
      add(3, two ? noun + place_ + "on the left" : "leftmost " + noun);
    if (most([](const Seen& one) { return -one.at.y; }))
      add(3, two ? noun + place_ + "on the right" : "rightmost " + noun);
    if (most([&](const Seen& one) { return -distance(one); })) {
      add(3, noun + place_ + (two ? "closer to the robot" : "closest to the robot"));
      add(3, two ? "nearer " + noun : "nearest " + noun);
    }
    if (most(distance))
      add(3, noun + place_ + (two ? "farther from the robot" : "farthest from the robot"));
  }

  std::vector<Seen> all_;
  const Seen* it_ = nullptr;
  const char* place_;
  References found_;
};

}  // namespace

bool may_be_called(std::string_view name, std::string_view phrase) {
  if (name == phrase) return true;
  if (name.size() <= phrase.size()) return false;
  const std::string_view rest = name.substr(phrase.size());
  return (name.ends_with(phrase) && name[name.size() - phrase.size() - 1] == ' ') ||
         (name.starts_with(phrase) && rest.starts_with(" of "));
}

References object_references(const World& world, const EpisodeScene& scene, int object,
                             const Pose& robot, std::span<const int> other_objects, bool far,
                             bool clauses) {
  return Describer(present_objects(world, scene, robot), object, clauses ? " that is " : " ")
      .describe(world, scene, robot, other_objects, far);
}

std::string draw_reference(const References& references, Rng& rng) {
  double sum = 0;
  for (std::size_t i = 0; i < kWeights.size(); ++i) sum += references[i].empty() ? 0 : kWeights[i];
  if (sum == 0) return "";
  double at = rng.uniform(0, sum);
  const std::vector<std::string>* of = nullptr;
  for (std::size_t i = 0; i < kWeights.size(); ++i) {
    if (references[i].empty()) continue;
    of = &references[i];
    if ((at -= kWeights[i]) < 0) break;
  }
  return (*of)[rng.below(static_cast<std::uint32_t>(of->size()))];
}

}  // namespace mjsense::tasks::scenes
