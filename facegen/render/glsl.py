"""The light of `facegen.render.shading` as OpenGL shaders, written for one scene.

Lights and materials become constants; what a vertex brings comes in four-float packs. The formulae and their order
are those of `shading.shade`: whoever changes one changes the other, and the tests compare the pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from numpy.typing import NDArray

from facegen.render import shading
from facegen.render.scene import Scene

_VERTEX = """#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
{inputs}
uniform mat4 V;
uniform mat4 P;
centroid out vec3 smooth_normal;
{outputs}
{tint_out}flat out vec4 albedo_specular;
flat out vec4 wrap_shininess;
flat out vec2 catch_lift;

const vec4 ALBEDO_SPECULAR[{count}] = vec4[]({albedo_specular});
const vec4 WRAP_SHININESS[{count}] = vec4[]({wrap_shininess});
const vec2 CATCH_LIFT[{count}] = vec2[]({catch_lift});

void main() {{
    gl_Position = P * (V * vec4(position, 1.0));
    smooth_normal = normal;
    {pass_on}
    {tint}
    int material = int({material} + 0.5);
    albedo_specular = ALBEDO_SPECULAR[material];
    wrap_shininess = WRAP_SHININESS[material];
    catch_lift = CATCH_LIFT[material];
}}
"""

# Without `centroid` a pixel on the outline would be shaded at its centre, outside the triangle.
_FRAGMENT = """#version 330 core
uniform vec3 lens;      // the target's place in pixels, and one over the focal length (0: parallel rays)
centroid in vec3 smooth_normal;
{inputs}
{tint_in}flat in vec4 albedo_specular;
flat in vec4 wrap_shininess;
flat in vec2 catch_lift;
layout(location = 0) out vec4 colour;

vec3 normal, viewer, diffuse, shine;

void lamp(vec3 towards, vec3 light, float highlight, float reach) {{
    float facing = dot(towards, normal);
    vec3 wrap = wrap_shininess.rgb;
    diffuse += light * max((facing + wrap) / (1.0 + wrap), 0.0) * reach;
    float cosine = dot(normalize(viewer + towards), normal);
    float lobe = exp(-wrap_shininess.a * (1.0 - cosine)) * clamp(4.0 * facing, 0.0, 1.0);
    shine += light * (lobe * reach * albedo_specular.a * highlight);
}}

vec3 ambient(vec3 albedo, float open) {{
    vec3 light = mix({ground}, {sky}, 0.5 + 0.5 * normal.y);
    return light * open / (1.0 - {bounce} * albedo * (1.0 - open));
}}

void main() {{
    vec2 place = (gl_FragCoord.xy - lens.xy) * lens.z;
    viewer = normalize(vec3(-place.x, place.y, 1.0));
    normal = (gl_FrontFacing ? smooth_normal : -smooth_normal);
    normal /= max(length(normal), 1e-12);
    vec3 linear;
    if (gl_FrontFacing) {{
        float share[{shares}] = float[]({share_list});
        if (catch_lift.y > 0.0)
            for (int k = 0; k < {shares}; k++) share[k] = pow(max(share[k], 0.0), 1.0 - catch_lift.y);
        vec3 albedo = {albedo};
        diffuse = ambient(albedo, {darkest} + {rest} * pow(max(share[0], 0.0), {cavity}));
        shine = vec3(0.0);
        {lamps}
        if (catch_lift.x > 0.0) {{
            float cosine = dot(normalize(viewer + {window}), normal);
            shine += catch_lift.x * clamp((cosine - {window_gone}) / {window_edge}, 0.0, 1.0);
        }}
        linear = diffuse * albedo + shine;
    }} else {{
        linear = {inside} * ambient({inside}, {inside_light});
    }}
    vec3 above = max(linear - {shoulder}, 0.0);
    colour = vec4(min(linear, {shoulder}) + above * {room} / (above + {room}), 1.0);
}}
"""


def vertex_shader(slots: Sequence[int], shares: int, materials: NDArray, *, tinted: bool = False) -> str:
    """Return the vertex shader.

    slots: floats of each attribute after position and normal; they hold ``shares`` light shares, then the index of
    the material, then if ``tinted`` the vertex's own albedo. materials: (k, 10), see `shading.material_rows`.
    """
    values = [f"extra_{a}.{'xyzw'[c]}" for a, size in enumerate(slots) for c in range(size)]
    return _VERTEX.format(
        inputs="\n".join(f"layout(location = {2 + a}) in vec{size} extra_{a};" for a, size in enumerate(slots)),
        outputs=_packs("out", shares),
        pass_on="\n    ".join(f"{place} = {value};" for place, value in zip(_places(shares), values, strict=False)),
        material=values[shares],
        tint_out="centroid out vec3 tint;\n" if tinted else "",
        tint=f"tint = vec3({', '.join(values[shares + 1:shares + 4])});" if tinted else "",
        count=len(materials),
        albedo_specular=_list(materials[:, [0, 1, 2, 6]]),
        wrap_shininess=_list(materials[:, [3, 4, 5, 7]]),
        catch_lift=_list(materials[:, 8:]),
    )


def fragment_shader(scene: Scene, inside: NDArray, *, tinted: bool = False) -> str:
    """Return the fragment shader; ``inside`` (3,) is the linear colour of back faces."""
    shares = 1 + len(scene.lights)
    lamps = [f"lamp({_vector(way)}, {_vector(light.colour)}, {_number(light.highlight)}, share[{k}]);"
             for k, (way, light) in enumerate(zip(shading.light_directions(scene), scene.lights, strict=True), start=1)]
    return _FRAGMENT.format(
        tint_in="centroid in vec3 tint;\n" if tinted else "", albedo="tint" if tinted else "albedo_specular.rgb",
        inputs=_packs("in", shares), shares=shares, share_list=", ".join(_places(shares)),
        lamps="\n        ".join(lamps),
        sky=_vector(scene.sky), ground=_vector(scene.ground), window=_vector(shading.unit(scene.window)),
        inside=_vector(inside),
        bounce=_number(shading.BOUNCE), darkest=_number(shading.DARKEST), rest=_number(1 - shading.DARKEST),
        cavity=_number(shading.CAVITY), inside_light=_number(shading.INSIDE_LIGHT),
        window_gone=_number(shading.WINDOW_GONE),
        window_edge=_number(shading.WINDOW_FULL - shading.WINDOW_GONE),
        shoulder=_number(shading.SHOULDER), room=_number(1 - shading.SHOULDER),
    )


def _packs(direction: str, shares: int) -> str:
    return "\n".join(f"centroid {direction} vec4 shares_{pack};" for pack in range((shares + 3) // 4))


def _places(shares: int) -> list[str]:
    return [f"shares_{k // 4}.{'xyzw'[k % 4]}" for k in range(shares)]


def _list(rows: NDArray) -> str:
    return ", ".join(_vector(row) for row in rows)


def _vector(values: Iterable[float]) -> str:
    numbers = [_number(v) for v in values]
    return f"vec{len(numbers)}({', '.join(numbers)})"


def _number(value: float) -> str:
    return repr(float(value))                            # always with a point or an exponent: GLSL wants one

