"""The people of a run: who answers, who is on call, and who is notified."""
