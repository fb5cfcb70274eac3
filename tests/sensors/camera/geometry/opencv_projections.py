"""Writes `opencv_projections.csv` beside it to standard output; needs OpenCV.

python opencv_projections.py > opencv_projections.csv
"""

import csv
import sys

import numpy as np

LENSES = {
    "pinhole": [0.0, 0.0, 0.0, 0.0, 0.0],
    "barrel": [-0.35, 0.12, 0.0, 0.0, -0.02],
    "pincushion": [0.25, -0.05, 0.0, 0.0, 0.03],
    "tangential": [0.0, 0.0, 0.004, -0.003, 0.0],
    "all": [-0.28, 0.09, 0.0012, -0.0008, -0.011],
}
COLUMNS = (
    "lens,k1,k2,p1,p2,k3,focal_x,focal_y,center_x,center_y,"
    "rotation_x,rotation_y,rotation_z,camera_east_m,camera_north_m,camera_up_m,"
    "east_m,north_m,up_m,pixel_x,pixel_y"
)


def main():
    import cv2  # type: ignore  no dependency of ours

    random = np.random.default_rng(7)
    sys.stdout.write(
        f"# cv2.projectPoints of OpenCV {cv2.__version__}, by "
        "opencv_projections.py beside this file, seed 7.\n"
        "# rotation: Rodrigues vector, world to camera. Places in metres, pixels in "
        "pixels; up to 57 degrees off the axis.\n"
    )
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(COLUMNS.split(","))
    for lens, distortion in LENSES.items():
        focal = np.round(random.uniform(250, 900, 2), 2)
        center = np.round(random.uniform(120, 400, 2), 2)
        rotation = np.round(random.normal(0, 1, 3), 3)
        place = np.round(random.normal(0, 20, 3), 2)
        matrix, _ = cv2.Rodrigues(rotation)
        ahead = random.uniform(0.5, 200, 8)
        seen = np.column_stack([random.uniform(-1.1, 1.1, (8, 2)), np.ones(8)])
        points = np.round((seen * ahead[:, None]) @ matrix + place, 3)
        intrinsic = np.diag([*focal, 1.0])
        intrinsic[:2, 2] = center
        pixels, _ = cv2.projectPoints(
            points[:, None], rotation, -matrix @ place, intrinsic, np.array(distortion)
        )
        for point, pixel in zip(points, pixels[:, 0], strict=True):
            numbers = (distortion, focal, center, rotation, place, point, pixel)
            rows.writerow([lens, *(float(n) for part in numbers for n in part)])


if __name__ == "__main__":
    main()
