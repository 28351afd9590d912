"""The old man: his script, and that his mouth's lining lies within his cheeks."""

from authored import AVATARS, check_script, crossings, part

from facegen.fileio.avatar import load_avatar


def test_the_script_writes_what_ships(tmp_path):
    check_script("human", tmp_path, last_decimal=2e-4)


def test_the_lining_of_the_mouth_does_not_come_through_the_skin():
    mesh = load_avatar(AVATARS / "human" / "human.obj").mesh
    skin, lining = part(mesh, "skin"), part(mesh, "mouth")
    corners, bag = mesh.vertices[skin], mesh.vertices[lining].reshape(-1, 3)
    near = ((corners.max(axis=1) >= bag.min(axis=0)) & (corners.min(axis=1) <= bag.max(axis=0))).all(axis=1)
    skin = skin[near & (corners[:, :, 2].max(axis=1) > 0)]          # farther back is the throat's
    assert crossings(mesh.vertices, lining, skin) == []
    assert crossings(mesh.vertices, skin, lining) == []
