"""The record of a study on disk: sessions, journals, participants, exports, withdrawals."""
