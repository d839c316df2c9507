// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/floor.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <numbers>
#include <numeric>

#include "mjsense_tasks/scenes/generators/floor_plan.h"
#include "mjsense_tasks/scenes/generators/furniture.h"
#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"
#include "mjsense_tasks/scenes/generators/walls.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr int kAttempts = 60;  // positions tried per piece
// m, maximum displacement of a piece between episodes in each direction; the first one that fits is
// used.
constexpr std::array<double, 4> kMoves{0.20, 0.14, 0.09, 0.05};
constexpr double kTableMove =
    0.05;  // m: small, because a mobile robot must be able to stop close to objects on the table

enum class RoomKind { kLiving, kBedroom, kDining, kStudy, kSecondBedroom, kReading };
constexpr std::array<const char*, 6> kRoomNames{"living", "bedroom", "dining",
                                                "study",  "guest",   "reading"};
// The same in instructions.
constexpr std::array<const char*, 6> kRoomTexts{"living room", "bedroom",    "dining room",
                                                "study",       "guest room", "reading room"};

std::vector<Furniture> pieces_of(RoomKind kind) {
  using enum Furniture;
  switch (kind) {
    case RoomKind::kLiving:
      return {kSofa, kTelevision, kArmchair, kBookcase, kFloorLamp, kPlant};
    case RoomKind::kBedroom:
      return {kBed, kWardrobe, kNightstand, kPlant};
    case RoomKind::kDining:
      return {kSideboard, kPlant, kBookcase};
    case RoomKind::kStudy:
      return {kDesk, kBookcase, kArmchair, kFloorLamp};
    case RoomKind::kSecondBedroom:
      return {kBed, kNightstand, kSideboard};
    case RoomKind::kReading:
      break;
  }
  return {kArmchair, kFloorLamp, kBookcase, kSideboard, kPlant};
}

std::string name_of(Furniture piece) {
  constexpr std::array<const char*, 11> kNames{"sofa",  "tv_stand",   "bookcase",  "desk",
                                               "bed",   "wardrobe",   "sideboard", "armchair",
                                               "plant", "floor_lamp", "nightstand"};
  return kNames[static_cast<int>(piece)];
}

// Placement with the back to a wall: side 0 .. 3 = y1, x1, y0, x0 of the room.
struct Stand {
  Vec3 at;
  double yaw;
  Rect space;
};

Stand against_wall(const Rect& room, int side, double along, FloorSpace size) {
  const double w = 0.5 * kWallThickness + 0.004, half = 0.5 * size.width;
  switch (side) {
    case 0:
      return {{along, room.y1 - w, 0},
              0,
              {along - half, room.y1 - w - size.depth, along + half, room.y1 - w}};
    case 1:
      return {{room.x1 - w, along, 0},
              -0.5 * pi,
              {room.x1 - w - size.depth, along - half, room.x1 - w, along + half}};
    case 2:
      return {{along, room.y0 + w, 0},
              pi,
              {along - half, room.y0 + w, along + half, room.y0 + w + size.depth}};
    default:
      return {{room.x0 + w, along, 0},
              0.5 * pi,
              {room.x0 + w, along - half, room.x0 + w + size.depth, along + half}};
  }
}

class Furnisher {
 public:
  Furnisher(RoomWriter& out, FloorPlan& plan, Rng& rng, SceneFileCfg& cfg)
      : out_(out), plan_(plan), rng_(rng), cfg_(cfg) {}

  // Lets furniture move between episodes: pieces at walls along the wall, tables in the middle of a
  // room along both axes, as far as paths remain free. Objects on furniture move with it. Call it
  // after all rooms are furnished.
  void loosen() {
    for (const Piece& piece : pieces_) {
      const Rect& s = piece.space;
      for (const double maximum : kMoves) {
        const double move =
            piece.along_x && piece.along_y ? std::min(maximum, kTableMove) : maximum;
        const double x = piece.along_x ? move : 0, y = piece.along_y ? move : 0;
        if (!plan_.widen(piece.room, s, {s.x0 - x, s.y0 - y, s.x1 + x, s.y1 + y})) continue;
        SceneVaryCfg vary;
        vary.what = VaryKind::kBody;
        vary.pattern = "room/" + piece.name;
        vary.pos = {x, y, 0};
        cfg_.vary.push_back(std::move(vary));
        break;
      }
    }
  }

  void furnish(int room, RoomKind kind) {
    const Rect& r = plan_.rooms()[room];
    const std::string where = kRoomNames[static_cast<int>(kind)];
    room_text_ = kRoomTexts[static_cast<int>(kind)];
    if (kind == RoomKind::kDining) table(room, where);
    for (const Furniture piece : pieces_of(kind)) {
      const FloorSpace size = floor_space(piece);
      for (int attempt = 0; attempt < kAttempts; ++attempt) {
        const int side = static_cast<int>(rng_.below(4));
        const double low = side % 2 == 0 ? r.x0 : r.y0, high = side % 2 == 0 ? r.x1 : r.y1;
        const double half = 0.5 * size.width + 0.5 * kWallThickness + 0.01;
        if (high - low < 2 * half) continue;
        const Stand stand = against_wall(r, side, rng_.uniform(low + half, high - half), size);
        if (!plan_.fits(room, stand.space)) continue;
        plan_.take(stand.space);
        place(piece, room, where, stand);
        pieces_.back().along_x = side % 2 == 0;
        pieces_.back().along_y = side % 2 != 0;
        if (piece == Furniture::kSofa) before_sofa(room, where, stand);
        break;
      }
    }
  }

 private:
  // Names the latest region in instructions.
  void label_region(const std::string& piece) {
    cfg_.regions.back().text = fmt::format("{} in the {}", piece, room_text_);
  }
  std::string unique(const std::string& name) {
    const int n = count_[name]++;
    return n == 0 ? name : fmt::format("{}_{}", name, n);
  }
  void place(Furniture piece, int room, const std::string& where, const Stand& stand) {
    const std::string name = unique(fmt::format("{}_{}", where, name_of(piece)));
    pieces_.push_back({name, room, stand.space});
    RoomWriter::Local local(out_, name, stand.at, stand.yaw);
    const std::size_t before = cfg_.regions.size();
    write_furniture(out_, piece, name, rng_, cfg_.regions);
    if (cfg_.regions.size() > before)
      label_region(piece == Furniture::kTelevision ? "television stand" : name_of(piece));
  }
  void table(int room, const std::string& where) {
    const Rect& r = plan_.rooms()[room];
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const bool along_x = rng_.below(2) == 0;
      const double hx = along_x ? 0.75 : 0.85, hy = along_x ? 0.85 : 0.75;
      if (r.width() < 2 * hx + 0.2 || r.depth() < 2 * hy + 0.2) continue;
      const double x = rng_.uniform(r.x0 + hx + 0.08, r.x1 - hx - 0.08),
                   y = rng_.uniform(r.y0 + hy + 0.08, r.y1 - hy - 0.08);
      const Rect space{x - hx, y - hy, x + hx, y + hy};
      if (!plan_.fits(room, space)) continue;
      plan_.take(space);
      const std::string name = unique(where + "_table");
      pieces_.push_back({name, room, space, true, true});
      RoomWriter::Local local(out_, name, {x, y, 0}, along_x ? 0 : 0.5 * pi);
      write_dining_table(out_, name, 4, rng_, cfg_.regions);
      label_region("dining table");
      return;
    }
  }
  void before_sofa(int room, const std::string& where, const Stand& sofa) {
    const Pose frame{sofa.at, axis_angle({0, 0, 1}, sofa.yaw)};
    const Vec3 middle = frame * Vec3{0, -1.42, 0};
    const bool along_x = std::abs(std::sin(sofa.yaw)) < 0.5;
    const double hx = along_x ? 0.55 : 0.30, hy = along_x ? 0.30 : 0.55;
    const Rect space{middle.x - hx, middle.y - hy, middle.x + hx, middle.y + hy};
    if (!plan_.fits(room, space)) return;
    plan_.take(space);
    const std::string name = unique(where + "_coffee_table");
    pieces_.push_back({name, room, space, true, true});
    RoomWriter::Local local(out_, name, middle, sofa.yaw);
    write_rug(out_, "cloth_3", 1.15, 0.70);
    write_coffee_table(out_, name, rng_, cfg_.regions);
    label_region("coffee table");
  }

  struct Piece {
    std::string name;
    int room;
    Rect space;
    bool along_x = false, along_y = false;  // axes along which it can be displaced
  };

  RoomWriter& out_;
  FloorPlan& plan_;
  Rng& rng_;
  SceneFileCfg& cfg_;
  std::map<std::string, int> count_;
  std::string room_text_;
  std::vector<Piece> pieces_;
};

void write_walls(RoomWriter& out, const FloorPlan& plan, Rng& rng) {
  RoomWriter::Local walls(out, "walls", {0, 0, 0}, 0);
  for (const PlannedWall& w : plan.walls()) {
    std::vector<Opening> openings;
    if (w.opening) openings.push_back({w.from, w.to, 0, 2.12});
    const double length = w.length(), wide = std::min(1.5, 0.45 * length);
    const bool window = w.other < 0 && length > 2.6 && rng.below(4) > 0;
    if (window) openings.push_back({0.5 * (length - wide), 0.5 * (length + wide), 1.0, 2.2});
    write_wall(out, {w.x0, w.y0, 0}, {w.x1, w.y1, 0}, openings);
    if (window) {
      write_window(out, {0.5 * (w.x0 + w.x1), 0.5 * (w.y0 + w.y1), 0}, w.along_x() ? 0 : 0.5 * pi,
                   wide, 1.0, 2.2);
    }
  }
}

// A picture at the centre of a wall without a window or opening.
void write_pictures(RoomWriter& out, const FloorPlan& plan, Rng& rng) {
  for (const PlannedWall& w : plan.walls()) {
    if (w.opening || w.other < 0 || w.length() < 1.2 || rng.below(2) == 0) continue;
    const double side = rng.below(2) == 0 ? 1 : -1, off = side * 0.5 * kWallThickness;
    const Vec3 at{0.5 * (w.x0 + w.x1) + (w.along_x() ? 0 : off),
                  0.5 * (w.y0 + w.y1) + (w.along_x() ? off : 0), 0};
    // The painting faces -y of its frame.
    const double yaw = w.along_x() ? (side > 0 ? pi : 0) : (side > 0 ? 0.5 * pi : -0.5 * pi);
    RoomWriter::Local local(out, "", at, yaw);
    write_painting(out, fmt::format("painting_{}", rng.below(3)), 0.7, 0.5, 1.6);
  }
}

scene::ModelSource make_floor(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  FloorPlan plan(rng);
  RoomWriter out("floor");
  write_shell_finishes(out, rng);
  write_furniture_materials(out, rng);
  for (int i = 0; i < 3; ++i) write_picture(out, fmt::format("painting_{}", i), rng);
  const Gloss polished{.specular = 0.15, .shininess = 0.3, .reflectance = 0.02, .roughness = 0.5};
  for (int i = 0; i < 3; ++i) {
    const auto planks = rng.next();
    out.tiled(fmt::format("floor_{}", i),
              planks_picture(brighter(wood_colour(rng), 0.85), 8, planks), 1.2, polished);
  }
  out.tiled("floor_3", tiles_picture({0.70, 0.68, 0.64}, {0.52, 0.51, 0.49}, 3, false, rng.next()),
            1.2, polished);

  const auto& rooms = plan.rooms();
  const Rect& all = plan.whole();
  out.slab(Facing::kDown, {0.5 * all.x1, 0.5 * all.y1, kWallHeight}, all.width(), all.depth(), 0.1,
           "ceiling_paint", {.name = "ceiling"});
  write_walls(out, plan, rng);
  write_pictures(out, plan, rng);
  // The largest room is the living room; the other kinds are assigned by size.
  std::vector<int> order(rooms.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, [&](int a, int b) { return rooms[a].area() > rooms[b].area(); });
  Furnisher furnisher(out, plan, rng, cfg);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Rect& r = rooms[order[k]];
    const double x = 0.5 * (r.x0 + r.x1), y = 0.5 * (r.y0 + r.y1);
    const std::string name = kRoomNames[k];
    out.slab(Facing::kUp, {x, y, 0}, r.width(), r.depth(), 0.1,
             fmt::format("floor_{}", rng.below(4)), {.name = "floor_" + name});
    out.lamp("lamp_" + name, {x, y, kWallHeight - 0.12}, 0.85, 3.6);
    out.upright_cylinder({x, y, kWallHeight - 0.03}, 0.16, 0.03, "shade", kVisual);
    furnisher.furnish(order[k], static_cast<RoomKind>(k));
  }
  write_bounce_light(out);
  furnisher.loosen();
  const Rect& living = rooms[order[0]];
  cfg.robot.pos = {0.5 * (living.x0 + living.x1), 0.5 * (living.y0 + living.y1), 0};
  return out.model();
}

}  // namespace

Generator floor_generator() {
  return {"floor", "Four to six furnished rooms, open to each other.", {}, make_floor};
}

}  // namespace mjsense::tasks::scenes
