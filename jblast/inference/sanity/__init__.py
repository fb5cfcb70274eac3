"""Whether a log can be of a blast at all: what laws of any charge say of its rows."""

from jblast.inference.sanity.doubts import doubts as doubts
