// Ways to make events of frames on a GPU: see event_kernel_candidates.py.
//
// Compiled once for each candidate, with RUN frames asked for together, PX pixels a
// thread, MODE of the light by which pixels are screened, AHEAD frames asked for
// together by `follow`. What a loud pixel does is the same everywhere, in float64.

typedef unsigned int u32;

#define FLOOR (0.5 / 255.0)
#define SLACK (16.0 * 2.220446049250313e-16)
#define CLOSE (16.0 * 1.1920928955078125e-07)

struct Camera {
  const float* behind;
  double rise, fall;
  int pixels;
};

// What all kernels are given last, in this order.
#define GIVEN                                                                          \
  const float *behind, double rise, double fall, int pixels, double *first, int *ups,  \
      int *downs, float2 *quiet_bounds, u32 *last_value, int *found, int *found_pixel,      \
      double *found_time, int *found_sign, int room_for
#define TAKEN                                              \
  const Camera c = {behind, rise, fall, pixels};           \
  const State s = {first, ups, downs, quiet_bounds, last_value}; \
  const Found f = {found, found_pixel, found_time, found_sign, room_for}

struct State {
  double* first;
  int* ups;
  int* downs;
  float2* quiet;
  u32* value;
};

struct Found {
  int* count;
  int* pixel;
  double* time;
  int* sign;
  int room;
};

__device__ __forceinline__ float exact_light(u32 w, float behind) {
#ifdef GREY
  return (float)w * (1.0f / 255.0f);
#else
  const float part = 1.0f / 255.0f;
  float grey = (0.2126f * part) * (float)(int)(w & 255u) +
               (0.7152f * part) * (float)(int)((w >> 8) & 255u) +
               (0.0722f * part) * (float)(int)((w >> 16) & 255u);
  float alpha = part * (float)(int)(w >> 24);
  return behind + alpha * (grey - behind);
#endif
}

// Error of the light by which pixels are screened, of full scale.
#if MODE == 1
#define ERR 0.0045f
#else
#define ERR 2e-6f
#endif

__device__ __forceinline__ float byte_float(u32 w, u32 which) {
  // 2^23 + byte, by its bits: no conversion
  return __uint_as_float(__byte_perm(w, 0x4B000000u, which)) - 8388608.0f;
}

__device__ __forceinline__ float quick_light(u32 w, float behind) {
#if MODE == 1
  // weights of 8 bits: 54 + 183 + 19 = 256
  float grey = (float)(int)__dp4a(w & 0xffffffu, 0x0013B736u, 0u);
  float alpha = (float)(int)(w >> 24);
  return behind + alpha * (grey * (1.0f / (65280.0f * 255.0f)) - behind * (1.0f / 255.0f));
#elif MODE == 2
  const float part = 1.0f / 255.0f;
  float grey = (0.2126f * part) * byte_float(w, 0x7540) +
               (0.7152f * part) * byte_float(w, 0x7541) +
               (0.0722f * part) * byte_float(w, 0x7542);
  float alpha = part * byte_float(w, 0x7543);
  return behind + alpha * (grey - behind);
#else
  return exact_light(w, behind);
#endif
}

__device__ __forceinline__ double log_light(float light) {
  return log(fmax((double)light, FLOOR));
}

__device__ __forceinline__ float2 bounds_of(double level, const Camera& c) {
  double wide = CLOSE * (1.0 + fabs(level));
  double lowest = exp(level - c.fall + wide);
  if (lowest < FLOOR) lowest = 0.0;
  return make_float2((float)lowest, (float)exp(level + c.rise - wide));
}

__device__ __forceinline__ u32 value_at(const void* frames, int k, int p, int pixels) {
#ifdef GREY
  return ((const unsigned char*)frames)[(size_t)k * pixels + p];
#else
  return ((const u32*)frames)[(size_t)k * pixels + p];
#endif
}

// One frame of a loud pixel; the level and the bounds follow.
struct Loud {
  double first, level, earlier;
  int up, down;
  float2 quiet;
  float light;
};

__device__ __forceinline__ Loud loud_of(int p, u32 value, double earlier,
                                        const Camera& c, const State& s) {
  Loud l;
  l.first = s.first[p];
  l.up = s.ups[p];
  l.down = s.downs[p];
  l.quiet = s.quiet[p];
  l.level = l.first + l.up * c.rise - l.down * c.fall;
  l.light = exact_light(value, c.behind[p]);
  l.earlier = earlier;
  return l;
}

__device__ __forceinline__ void next_frame(Loud& l, u32 value, double time, int p,
                                           const Camera& c, const Found& f) {
  float before_light = l.light;
  l.light = exact_light(value, c.behind[p]);
  if (l.light > l.quiet.y || l.light < l.quiet.x) {
    double now = log_light(l.light);
    double change = now - l.level, slack = SLACK * (1.0 + fabs(now));
    int more = max((int)floor((change + slack) / c.rise), 0);
    int less = max((int)floor((slack - change) / c.fall), 0);
    int number = more + less;
    if (number > 0) {
      double before = log_light(before_light);
      double step = more > 0 ? c.rise : -c.fall;
      int slot = atomicAdd(f.count, number);
      for (int n = 0; n < number; ++n)
        if (slot + n < f.room) {
          double share = (l.level + (n + 1) * step - before) / (now - before);
          share = fmin(fmax(share, 0.0), 1.0);
          f.pixel[slot + n] = p;
          f.time[slot + n] = l.earlier + share * (time - l.earlier);
          f.sign[slot + n] = more > 0 ? 1 : -1;
        }
      l.up += more;
      l.down += less;
      l.level = l.first + l.up * c.rise - l.down * c.fall;
      l.quiet = bounds_of(l.level, c);
    }
  }
  l.earlier = time;
}

__device__ __forceinline__ void keep(const Loud& l, int p, const State& s) {
  s.ups[p] = l.up;
  s.downs[p] = l.down;
  s.quiet[p] = l.quiet;
}

// A loud pixel through the frames of a run, read once more: they are in a cache.
__device__ __noinline__ void take(const void* frames, const double* times, int p,
                                  int start, int stop, double earlier, u32 before,
                                  const Camera c, const State s, const Found f) {
  Loud l = loud_of(p, before, earlier, c, s);
  for (int k = start; k < stop; ++k)
    next_frame(l, value_at(frames, k, p, c.pixels), times[k], p, c, f);
  keep(l, p, s);
}

extern "C" {

__global__ void begin(const void* frames, GIVEN) {
  TAKEN;
  int p = blockIdx.x * blockDim.x + threadIdx.x;
  if (p >= c.pixels) return;
  u32 value = value_at(frames, 0, p, c.pixels);
  double level = log_light(exact_light(value, c.behind[p]));
  s.first[p] = level;
  s.ups[p] = 0;
  s.downs[p] = 0;
  s.quiet[p] = bounds_of(level, c);
  s.value[p] = value;
}

// Two kernels, as they were: all pixels are screened, the loud ones are listed.
__global__ void screen(const void* frames, int start, int stop, int* count, int* listed,
                       GIVEN) {
  TAKEN;
  int p = blockIdx.x * blockDim.x + threadIdx.x;
  if (p >= c.pixels) return;
  float back = c.behind[p], top = 0.0f, low = 1e30f;
  for (int k = start; k < stop; k += RUN)
#pragma unroll
    for (int j = 0; j < RUN; ++j) {
      float light = quick_light(value_at(frames, min(k + j, stop - 1), p, c.pixels), back);
      top = fmaxf(top, light);
      low = fminf(low, light);
    }
  float2 quiet = s.quiet[p];
  if (top > quiet.y - ERR || low < quiet.x + ERR) listed[atomicAdd(count, 1)] = p;
}

__global__ void follow(const void* frames, const double* times, int start, int stop,
                       double last_time, const int* count, const int* listed, GIVEN) {
  TAKEN;
  int t = blockIdx.x * blockDim.x + threadIdx.x;
  if (t >= *count) return;
  int p = listed[t];
  u32 before = start ? value_at(frames, start - 1, p, c.pixels) : s.value[p];
  Loud l = loud_of(p, before, last_time, c, s);
  for (int k = start; k < stop; k += AHEAD) {
    u32 v[AHEAD];
#pragma unroll
    for (int j = 0; j < AHEAD; ++j) v[j] = value_at(frames, min(k + j, stop - 1), p, c.pixels);
#pragma unroll 1
    for (int j = 0; j < min(AHEAD, stop - k); ++j) next_frame(l, v[j], times[k + j], p, c, f);
  }
  keep(l, p, s);
}

#ifndef GREY
#if PX == 4
typedef uint4 Wide;
#elif PX == 2
typedef uint2 Wide;
#else
typedef u32 Wide;
#endif
union Words {
  Wide wide;
  u32 one[PX];
};

__device__ __forceinline__ void look(const Words (&v)[RUN], const u32 (&last)[PX],
                                     const float (&behind)[PX], float2 (&quiet)[PX],
                                     const void* frames, const double* times, int p,
                                     int k, int stop, double earlier, const Camera& c,
                                     const State& s, const Found& f) {
  u32 loud = 0;
#pragma unroll
  for (int i = 0; i < PX; ++i) {
#if MODE == 3
    u32 changed = 0;
#pragma unroll
    for (int j = 0; j < RUN; ++j) changed |= v[j].one[i] ^ last[i];
    if (!changed) continue;
#endif
    float top = 0.0f, low = 1e30f;
#pragma unroll
    for (int j = 0; j < RUN; ++j) {
      float light = quick_light(v[j].one[i], behind[i]);
      top = fmaxf(top, light);
      low = fminf(low, light);
    }
    if (top > quiet[i].y - ERR || low < quiet[i].x + ERR) loud |= 1u << i;
  }
  if (loud)
#pragma unroll
    for (int i = 0; i < PX; ++i)
      if (loud >> i & 1u) {
        take(frames, times, p + i, k, min(k + RUN, stop), earlier, last[i], c, s, f);
        quiet[i] = s.quiet[p + i];
      }
}

// One kernel: a run of frames in registers, and where it is loud, followed at once.
__global__ void __launch_bounds__(THREADS) fused(const void* frames, const double* times,
                                                 int start, int stop, double last_time,
                                                 GIVEN) {
  TAKEN;
  int p = PX * (blockIdx.x * blockDim.x + threadIdx.x);
  if (p >= c.pixels) return;
  float back[PX];
  float2 quiet[PX];
  u32 last[PX];
#pragma unroll
  for (int i = 0; i < PX; ++i) {
    back[i] = c.behind[p + i];
    quiet[i] = s.quiet[p + i];
    last[i] = start ? value_at(frames, start - 1, p + i, c.pixels) : s.value[p + i];
  }
  double earlier = last_time;
  for (int k = start; k < stop; k += RUN) {
    Words v[RUN];
#pragma unroll
    for (int j = 0; j < RUN; ++j)
      v[j].wide = *(const Wide*)((const u32*)frames + (size_t)min(k + j, stop - 1) * c.pixels + p);
    look(v, last, back, quiet, frames, times, p, k, stop, earlier, c, s, f);
#pragma unroll
    for (int i = 0; i < PX; ++i) last[i] = v[RUN - 1].one[i];
    earlier = times[min(k + RUN, stop) - 1];
  }
}

#if PX == 4
// The same, the next run on its way to shared memory while this one is looked at.
__global__ void __launch_bounds__(THREADS) staged(const void* frames, const double* times,
                                                  int start, int stop, double last_time,
                                                  GIVEN) {
  TAKEN;
  extern __shared__ uint4 room[];
  int p = PX * (blockIdx.x * blockDim.x + threadIdx.x);
  if (p >= c.pixels) return;
  float back[PX];
  float2 quiet[PX];
  u32 last[PX];
#pragma unroll
  for (int i = 0; i < PX; ++i) {
    back[i] = c.behind[p + i];
    quiet[i] = s.quiet[p + i];
    last[i] = start ? value_at(frames, start - 1, p + i, c.pixels) : s.value[p + i];
  }
  double earlier = last_time;
  int half = 0;
  auto ask = [&](int k, int which) {
#pragma unroll
    for (int j = 0; j < RUN; ++j) {
      const u32* from = (const u32*)frames + (size_t)min(k + j, stop - 1) * c.pixels + p;
      u32 to = (u32)__cvta_generic_to_shared(&room[(which * RUN + j) * THREADS + threadIdx.x]);
      asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to), "l"(from));
    }
    asm volatile("cp.async.commit_group;");
  };
  ask(start, 0);
  for (int k = start; k < stop; k += RUN) {
    if (k + RUN < stop) {
      ask(k + RUN, half ^ 1);
      asm volatile("cp.async.wait_group 1;" ::: "memory");
    } else {
      asm volatile("cp.async.wait_group 0;" ::: "memory");
    }
    Words v[RUN];
#pragma unroll
    for (int j = 0; j < RUN; ++j) v[j].wide = room[(half * RUN + j) * THREADS + threadIdx.x];
    look(v, last, back, quiet, frames, times, p, k, stop, earlier, c, s, f);
#pragma unroll
    for (int i = 0; i < PX; ++i) last[i] = v[RUN - 1].one[i];
    earlier = times[min(k + RUN, stop) - 1];
    half ^= 1;
  }
}
#endif

#elif PX >= 4
// Grey of 8 bits: four pixels a word, extremes and bounds as bytes.
__device__ __forceinline__ u32 low_byte(float2 q) {
  return (u32)min(max((int)ceilf(q.x * 255.0f + 1e-3f), 0), 255);
}
__device__ __forceinline__ u32 high_byte(float2 q) {
  return (u32)min(max((int)floorf(q.y * 255.0f - 1e-3f), 0), 255);
}

__global__ void __launch_bounds__(THREADS) fused(const void* frames, const double* times,
                                                 int start, int stop, double last_time,
                                                 GIVEN) {
  TAKEN;
  const int WORDS = PX / 4;
  int p = PX * (blockIdx.x * blockDim.x + threadIdx.x);
  if (p >= c.pixels) return;
  u32 low[WORDS], high[WORDS];
#pragma unroll
  for (int w = 0; w < WORDS; ++w) {
    low[w] = high[w] = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      float2 q = s.quiet[p + 4 * w + i];
      low[w] |= low_byte(q) << (8 * i);
      high[w] |= high_byte(q) << (8 * i);
    }
  }
  double earlier = last_time;
  for (int k = start; k < stop; k += RUN) {
    u32 top[WORDS], bottom[WORDS];
#pragma unroll
    for (int w = 0; w < WORDS; ++w) {
      u32 v[RUN];
#pragma unroll
      for (int j = 0; j < RUN; ++j)
        v[j] = ((const u32*)frames)[((size_t)min(k + j, stop - 1) * c.pixels + p) / 4 + w];
      top[w] = bottom[w] = v[0];
#pragma unroll
      for (int j = 1; j < RUN; ++j) {
        top[w] = __vmaxu4(top[w], v[j]);
        bottom[w] = __vminu4(bottom[w], v[j]);
      }
    }
#pragma unroll
    for (int w = 0; w < WORDS; ++w) {
      u32 loud = __vcmpgtu4(top[w], high[w]) | __vcmpltu4(bottom[w], low[w]);
      for (int i = 0; loud; ++i, loud >>= 8)
        if (loud & 255u) {
          int at = p + 4 * w + i;
          u32 before = k ? value_at(frames, k - 1, at, c.pixels) : s.value[at];
          take(frames, times, at, k, min(k + RUN, stop), earlier, before, c, s, f);
          float2 q = s.quiet[at];
          low[w] = (low[w] & ~(255u << (8 * i))) | low_byte(q) << (8 * i);
          high[w] = (high[w] & ~(255u << (8 * i))) | high_byte(q) << (8 * i);
        }
    }
    earlier = times[min(k + RUN, stop) - 1];
  }
}
#endif

// The last values of a block of frames, for the next.
__global__ void finish(const void* frames, int count, GIVEN) {
  TAKEN;
  int p = blockIdx.x * blockDim.x + threadIdx.x;
  if (p < c.pixels) s.value[p] = value_at(frames, count - 1, p, c.pixels);
}
}
