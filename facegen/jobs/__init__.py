"""Many pictures: a data set from one file, the frames of a clip; over cores or machines, stopped and taken up again."""
