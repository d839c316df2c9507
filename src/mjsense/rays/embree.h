// SPDX-License-Identifier: Apache-2.0
#pragma once
// Embree 4 or 3 behind one face: packets of kWidth rays against a scene of triangles. Packets of another
// width than the CPU's vectors Embree copies a ray at a time, and casts the rays that are not valid, too.
// Origins and directions are finite in every lane of a packet, valid or not: Debian's Embree has
// assertions.
// Unnamed namespace: each instruction set keeps its own copy.

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "mjsense/rays/simd.h"

namespace mjsense {
namespace {

template <int kLanesOfPacket>
struct EmbreePacket;
template <>
struct EmbreePacket<4> {
  using Rays = RTCRay4;
  using RayHits = RTCRayHit4;
  static constexpr auto intersect = rtcIntersect4;
  static constexpr auto occluded = rtcOccluded4;
};
template <>
struct EmbreePacket<8> {
  using Rays = RTCRay8;
  using RayHits = RTCRayHit8;
  static constexpr auto intersect = rtcIntersect8;
  static constexpr auto occluded = rtcOccluded8;
};
template <>
struct EmbreePacket<16> {
  using Rays = RTCRay16;
  using RayHits = RTCRayHit16;
  static constexpr auto intersect = rtcIntersect16;
  static constexpr auto occluded = rtcOccluded16;
};
using EmbreeRays = EmbreePacket<kWidth>::Rays;
using EmbreeRayHits = EmbreePacket<kWidth>::RayHits;

// Rejects hits on the back of triangles, for queries that cull them.
inline void reject_backfaces(const RTCFilterFunctionNArguments* args) {
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const float dot = RTCRayN_dir_x(args->ray, args->N, i) * RTCHitN_Ng_x(args->hit, args->N, i) +
                      RTCRayN_dir_y(args->ray, args->N, i) * RTCHitN_Ng_y(args->hit, args->N, i) +
                      RTCRayN_dir_z(args->ray, args->N, i) * RTCHitN_Ng_z(args->hit, args->N, i);
    if (dot > 0.0f) args->valid[i] = 0;
  }
}

#if RTC_VERSION_MAJOR >= 4

constexpr auto kSceneFlags =
    static_cast<RTCSceneFlags>(static_cast<int>(RTC_SCENE_FLAG_ROBUST) |
                               static_cast<int>(RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS));

// `coherent`: rays of neighbouring pixels, which begin or end in one place, go through the tree
// together: shadow rays of a packet take 4 to 9 % off whole images with meshes; the same hits.
inline void embree_intersect(const int* valid, RTCScene scene, EmbreeRayHits* rays, bool cull,
                             bool coherent) {
  RTCIntersectArguments args;
  rtcInitIntersectArguments(&args);
  if (coherent) args.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  if (cull) {
    args.flags =
        static_cast<RTCRayQueryFlags>(args.flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
    args.filter = reject_backfaces;
  }
  EmbreePacket<kWidth>::intersect(valid, scene, rays, &args);
}

inline void embree_occluded(const int* valid, RTCScene scene, EmbreeRays* rays, bool cull,
                            bool coherent) {
  RTCOccludedArguments args;
  rtcInitOccludedArguments(&args);
  if (coherent) args.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  if (cull) {
    args.flags =
        static_cast<RTCRayQueryFlags>(args.flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
    args.filter = reject_backfaces;
  }
  EmbreePacket<kWidth>::occluded(valid, scene, rays, &args);
}

#else

constexpr auto kSceneFlags =
    static_cast<RTCSceneFlags>(static_cast<int>(RTC_SCENE_FLAG_ROBUST) |
                               static_cast<int>(RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));

inline void embree_intersect(const int* valid, RTCScene scene, EmbreeRayHits* rays, bool cull,
                             bool coherent) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  if (cull) context.filter = reject_backfaces;
  EmbreePacket<kWidth>::intersect(valid, scene, &context, rays);
}

inline void embree_occluded(const int* valid, RTCScene scene, EmbreeRays* rays, bool cull,
                            bool coherent) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  if (cull) context.filter = reject_backfaces;
  EmbreePacket<kWidth>::occluded(valid, scene, &context, rays);
}

#endif

}  // namespace
}  // namespace mjsense
