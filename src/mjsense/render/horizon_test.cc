// SPDX-License-Identifier: Apache-2.0
// Rays above a mesh's horizon must not hit any of its triangles.

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/rays/mesh_geometry.h"
#include "mjsense/render/kernels/mesh_horizons.h"

namespace mjsense::render {
namespace {

struct Mesh {
  std::vector<float> vertices;
  std::vector<int> faces;

  void add(std::initializer_list<float> corners) {
    for (int i = 0; i < 3; ++i) faces.push_back(static_cast<int>(vertices.size() / 3) + i);
    vertices.insert(vertices.end(), corners);
  }
  const float* corner(int face, int i) const { return vertices.data() + 3 * faces[3 * face + i]; }
  int size() const { return static_cast<int>(faces.size() / 3); }
};

// Sine of the horizon of a face; Horizons::kNever if no ray is known to be clear.
float sine(const Mesh& mesh, int face, int octant) {
  const rays::MeshGeometry geometry(rays::MeshArrays(mesh.vertices, mesh.faces), true);
  const float* h = geometry.box.data() + 3;
  return find_horizon(*geometry.clusters, geometry.horizons->slot(face), octant,
                      std::hypot(h[0], h[1], h[2]));
}

constexpr int kPlusX = 0, kMinusX = 1;  // octants; y and z are positive

// A floor triangle, and a wall that is 2 m away and 1 m high: seen from the nearest point of the
// floor, its slope is 1/2.
TEST(Horizon, OfAWallIsItsHeightOverItsDistance) {
  Mesh mesh;
  mesh.add({0, 0, 0, 1, 0, 0, 0, 1, 0});
  EXPECT_NEAR(sine(mesh, 0, kPlusX), 2e-3, 1e-6);  // no geometry rises above the face
  mesh.add({3, -5, 0, 3, 5, 0, 3, 5, 1});
  mesh.add({3, -5, 0, 3, 5, 1, 3, -5, 1});
  const double half = 0.5 / std::hypot(1, 0.5) + 2e-3;
  EXPECT_NEAR(sine(mesh, 0, kPlusX), half, 1e-5);
  mesh.add({3, -5, -9, 3, 5, -9, 3, 5, -7});  // below the floor
  EXPECT_NEAR(sine(mesh, 0, kPlusX), half, 1e-5);
  EXPECT_NEAR(sine(mesh, 0, kMinusX), 2e-3, 1e-6);  // the wall is behind the face
  mesh.add({-0.01f, -9, 0, -0.01f, 9, 0, -0.01f, 9, 1});
  mesh.add({-0.01f, -9, 0, -0.01f, 9, 1, -0.01f, -9, 1});
  // Geometry just behind the face still counts, because rays start slightly off the face.
  EXPECT_EQ(sine(mesh, 0, kPlusX), rays::Horizons::kNever);
  for (std::size_t i = mesh.vertices.size() - 18; i < mesh.vertices.size(); i += 3)
    mesh.vertices[i] = -0.1f;
  EXPECT_NEAR(sine(mesh, 0, kPlusX), half, 1e-5);
  EXPECT_EQ(sine(mesh, 0, kMinusX), rays::Horizons::kNever);
  mesh.add({0.3f, 0.2f, 1, 0.5f, 0.2f, 1, 0.3f, 0.4f, 1});  // above the face
  EXPECT_EQ(sine(mesh, 0, kPlusX), rays::Horizons::kNever);
}

// Two faces that share an edge, and a third that touches only their common corner.
TEST(Horizon, OfANeighbourIsTheAngleBetweenTheFaces) {
  for (double angle : {-0.7, 0.0, 0.2, 0.6}) {
    const float c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
    Mesh mesh;
    mesh.add({0, 0, 0, 1, 0, 0, 0, 1, 0});
    mesh.add({0, 1, 0, -c, 0.5f, s, 0, 0, 0});
    const double expected = std::max(0.0, std::sin(angle)) + 2e-3;
    EXPECT_NEAR(sine(mesh, 0, kMinusX), expected, 1e-5) << angle;
    mesh.add({0, 0, 0, -c, -1, s, -1e-3f * c, -1, 1e-3f * s});
    for (int octant = 0; octant < rays::Horizons::kOctants; ++octant)
      EXPECT_LE(sine(mesh, 0, octant), expected + 1e-4) << angle << ", octant " << octant;
  }
}

// A horizon is computed once per face and octant, after enough rays have started on the face.
TEST(Horizon, IsComputedOnceAndNotForTheFirstRays) {
  Mesh mesh;
  mesh.add({0, 0, 0, 1, 0, 0, 0, 1, 0});
  mesh.add({0, 0, 2, 0, 1, 2, 0, 0, 3});
  const rays::Horizons horizons(
      rays::build_clusters(mesh.vertices.data(), mesh.faces.data(), mesh.size()));
  int found = 0;
  for (const float sine : {0.0f, 0.3f, 1.0f, rays::Horizons::kNever}) {
    const int face = found % 2, octant = found;
    const auto ask = [&] {
      return horizons.ask(face, octant, [&] {
        ++found;
        return sine;
      });
    };
    const int before = found;
    for (int i = 0; i < rays::Horizons::kMaxRequests; ++i) EXPECT_EQ(ask(), rays::Horizons::kNever);
    EXPECT_EQ(found, before);
    for (int i = 0; i < 5; ++i) {
      const float known = ask();
      EXPECT_LE(sine, known + 1e-6f);
      EXPECT_LT(known, sine + 6e-3f);
    }
    EXPECT_EQ(found, before + 1);
  }
  const float *floor = horizons.plane(0), *wall = horizons.plane(1);
  EXPECT_EQ(floor[2], 1);
  EXPECT_EQ(floor[3], 0);
  EXPECT_EQ(wall[0], 1);
}

bool meets(const float* const corners[3], const double o[3], const double d[3]) {
  double a[3], b[3], p[3], s[3], q[3];
  for (int k = 0; k < 3; ++k) {
    a[k] = corners[1][k] - corners[0][k];
    b[k] = corners[2][k] - corners[0][k];
    s[k] = o[k] - corners[0][k];
  }
  const auto cross = [](const double* x, const double* y, double* z) {
    for (int k = 0; k < 3; ++k)
      z[k] = x[(k + 1) % 3] * y[(k + 2) % 3] - x[(k + 2) % 3] * y[(k + 1) % 3];
  };
  const auto dot = [](const double* x, const double* y) {
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
  };
  cross(d, b, p);
  const double det = dot(a, p);
  if (det == 0) return false;
  const double u = dot(s, p) / det;
  cross(s, a, q);
  const double v = dot(d, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && dot(b, q) / det > 0;
}

// Rough balls with dents, and loose triangles around them. The rays start slightly above a point of
// a face, at the elevation of its horizon.
TEST(Horizon, RaysAboveItAreClear) {
  int clear = 0, low = 0;
  for (int scene = 0; scene < 6; ++scene) {
    Rng rng(3, 0, 1, scene);
    constexpr int n = 14;
    Mesh mesh;
    float radius[n * n];
    for (float& r : radius) r = static_cast<float>(1 + rng.uniform(-0.08, 0.08) * (scene % 3));
    const auto point = [&](int i, int j, float out[3]) {
      const double theta = M_PI * (i + 0.5) / n, phi = 2 * M_PI * (j % n) / n;
      const float r = radius[i * n + j % n] * (scene == 5 && j % n < 3 ? 0.5f : 1.0f);
      out[0] = r * static_cast<float>(std::sin(theta) * std::cos(phi));
      out[1] = r * static_cast<float>(std::sin(theta) * std::sin(phi));
      out[2] = r * static_cast<float>(std::cos(theta));
    };
    for (int i = 0; i + 1 < n; ++i)
      for (int j = 0; j < n; ++j) {
        float a[3], b[3], c[3], d[3];
        point(i, j, a), point(i + 1, j, b), point(i + 1, j + 1, c), point(i, j + 1, d);
        mesh.add({a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]});
        mesh.add({a[0], a[1], a[2], c[0], c[1], c[2], d[0], d[1], d[2]});
      }
    for (int i = 0; i < 10 * (scene % 2); ++i) {
      float x[9];
      for (float& coordinate : x) coordinate = static_cast<float>(rng.uniform(-1.5, 1.5));
      mesh.add({x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8]});
    }
    for (int face = 0; face < mesh.size(); face += 5) {
      const auto horizons = rays::mesh_horizons(rays::MeshArrays(mesh.vertices, mesh.faces));
      const float* normal = horizons->plane(face);
      float sines[rays::Horizons::kOctants];
      for (int i = 0; i < rays::Horizons::kOctants; ++i) sines[i] = sine(mesh, face, i);
      for (int ray = 0; ray < 40; ++ray) {
        double u = rng.uniform(), v = rng.uniform();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        double o[3], d[3], along = 0;
        for (int k = 0; k < 3; ++k) {
          const float* const c[3] = {mesh.corner(face, 0), mesh.corner(face, 1),
                                     mesh.corner(face, 2)};
          o[k] = c[0][k] + u * (c[1][k] - c[0][k]) + v * (c[2][k] - c[0][k]) + 1.5e-4 * normal[k];
          d[k] = rng.normal();
          along += d[k] * normal[k];
        }
        for (int k = 0; k < 3; ++k) d[k] -= along * normal[k];
        const double level = std::hypot(d[0], d[1], d[2]);
        const auto direction = [&](double sine, double up[3]) {
          for (int k = 0; k < 3; ++k)
            up[k] = std::sqrt(1 - sine * sine) * d[k] / level + sine * normal[k];
        };
        const auto hits = [&](const double up[3]) {
          for (int f = 0; f < mesh.size(); ++f) {
            const float* const c[3] = {mesh.corner(f, 0), mesh.corner(f, 1), mesh.corner(f, 2)};
            if (meets(c, o, up)) return true;
          }
          return false;
        };
        // Rays at the lowest elevation that counts as clear.
        for (int octant = 0; octant < rays::Horizons::kOctants; ++octant) {
          if (sines[octant] > 1) continue;
          double up[3];
          direction(sines[octant], up);
          if (octant != (up[0] < 0) + 2 * (up[1] < 0) + 4 * (up[2] < 0)) continue;
          EXPECT_FALSE(hits(up)) << "scene " << scene << " face " << face << " octant " << octant;
          ++clear;
          direction(0.8 * sines[octant] - 0.05, up);
          low += hits(up);
        }
      }
    }
  }
  EXPECT_GT(clear, 9000);
  EXPECT_GT(low, 100);  // the horizon is not far too high
}

}  // namespace
}  // namespace mjsense::render
