"""First page of a report on a certificate's folder."""
