/* What PufferLib's target.h needs of raylib to compile. Nothing here is ever called: the benchmark
 * steps the worlds and draws nothing. */
#ifndef RAYLIB_STAND_IN_H
#define RAYLIB_STAND_IN_H

#include <stdbool.h>

#ifndef PI
#define PI 3.14159265358979323846f
#endif
#define KEY_ESCAPE 256

typedef struct { int id, width, height; } Texture2D;
typedef struct { unsigned char r, g, b, a; } Color;
typedef struct { float x, y; } Vector2;
typedef struct { float x, y, width, height; } Rectangle;
#define WHITE ((Color){255, 255, 255, 255})

static inline void InitWindow(int width, int height, const char *title) {}
static inline void CloseWindow(void) {}
static inline void SetTargetFPS(int rate) {}
static inline Texture2D LoadTexture(const char *file) { return (Texture2D){0}; }
static inline void UnloadTexture(Texture2D texture) {}
static inline bool IsKeyDown(int key) { return false; }
static inline void BeginDrawing(void) {}
static inline void EndDrawing(void) {}
static inline void ClearBackground(Color color) {}
static inline void DrawTexture(Texture2D texture, int x, int y, Color tint) {}
static inline void DrawTexturePro(Texture2D texture, Rectangle from, Rectangle to, Vector2 origin,
                                  float angle, Color tint) {}

#endif
