"""Ports and buses: byte streams by URL, taps on every one, transcripts and their replay."""
