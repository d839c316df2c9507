// SPDX-License-Identifier: Apache-2.0
#pragma once
// One interface to Embree 4 and Embree 3: packets of kWidth rays against a scene of triangles. If
// the packet's width differs from that of the CPU's vectors, Embree copies the rays one by one and
// also casts those that are not valid. Origins and directions must be finite in every lane of a
// packet, valid or not, because Debian's Embree is built with assertions.
//
// The namespace is unnamed so that each instruction set keeps its own copy.

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "mjsense/core/simd.h"

namespace mjsense::rays {
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

// Rejects hits on the back of triangles. Used as a filter by queries that cull back faces.
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

// `coherent`: the rays belong to neighbouring pixels and start or end at one point, so Embree
// traverses the tree with all of them together. This saves 4 to 9 % of the time of whole images
// with meshes when used for a packet's shadow rays; the hits are the same.
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
}  // namespace mjsense::rays
