!> The points with which each point interacts, its family. The abstract type that lattice and list
!> families extend.
!>
!> Everything outside the hot loops works on `bonds_of`, which lists the bonds of one slot.
module pd_family_family
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_volume, only: volume_rule_type
  implicit none (type, external)
  private
  public :: family_type, bonds_type, allocate_bonds

  !> The bonds of one point, as far as `n`.
  type :: bonds_type
    integer :: n = 0
    integer(i4), allocatable :: j(:)       !! slots of the family members
    real(wp), allocatable :: xi(:, :)      !! x_j - x_k (bond, dim) [m]
    real(wp), allocatable :: length(:)     !! |xi| [m]
    real(wp), allocatable :: weight(:)     !! v_c V_j [m3]
    logical, allocatable :: intact(:)
  end type bonds_type

  type, abstract :: family_type
    integer :: dim = 0
    integer :: n_slots = 0
    integer :: most_bonds = 0              !! largest number of bonds of one point
    integer(i8) :: n_bonds = 0             !! ordered pairs at the start, pre-cracked ones included
    type(volume_rule_type) :: rule         !! v_c and how far a family reaches
  contains
    procedure(bonds_of_interface), deferred :: bonds_of
    procedure(break_interface), deferred :: break_bond
    procedure(keep_interface), deferred :: keep_bonds
    procedure(memory_interface), deferred :: bytes
    procedure(describe_interface), deferred :: describe
    procedure :: alike
    procedure :: may_have_broken
    procedure :: bytes_are_shared
    procedure :: level_of_bond
    procedure :: has_level
  end type family_type

  abstract interface
    !> All bonds of slot `k`, broken ones too, always in the same order.
    pure subroutine bonds_of_interface(family, k, bonds)
      import :: family_type, bonds_type
      implicit none (type, external)
      class(family_type), intent(in) :: family  !! the family
      integer, intent(in) :: k                  !! slot; a dead one has no bonds
      type(bonds_type), intent(inout) :: bonds
        !! made by `allocate_bonds`; the first `bonds%n` entries are set
    end subroutine bonds_of_interface

    !> Break the `i`-th bond of `bonds_of(k)`; the other direction is another call. Bonds of
    !> `lanes` slots that follow each other may share a byte: only one thread may break them.
    pure subroutine break_interface(family, k, i)
      import :: family_type
      implicit none (type, external)
      class(family_type), intent(inout) :: family  !! with this bond broken on return
      integer, intent(in) :: k                     !! slot whose bond is broken
      integer, intent(in) :: i                     !! number of the bond in `bonds_of(k)`, from 1
    end subroutine break_interface

    !> Keep which bonds are broken, or put it back.
    subroutine keep_interface(family, archive)
      import :: family_type, archive_type
      implicit none (type, external)
      class(family_type), intent(inout) :: family
        !! its broken bonds are set where the archive reads
      class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    end subroutine keep_interface

    !> Memory of the family [bytes].
    pure integer(i8) function memory_interface(family)
      import :: family_type, i8
      implicit none (type, external)
      class(family_type), intent(in) :: family  !! the family
    end function memory_interface

    !> What kind of family it is and why, in a line.
    function describe_interface(family) result(text)
      import :: family_type
      implicit none (type, external)
      class(family_type), intent(in) :: family  !! the family
      character(:), allocatable :: text
    end function describe_interface
  end interface

contains

  !> A slot, the same for all slots whose families are known to be alike (same material, same
  !> members at the same offsets, their slots the same number ahead), so that what follows from the
  !> family alone is computed once.
  pure integer function alike(family, k)
    class(family_type), intent(in) :: family
      !! the family; this version knows of no slots that are alike
    integer, intent(in) :: k                  !! slot
    alike = min(k, family%n_slots)
  end function alike

  !> Whether some bond of slot `k` may be broken: cheap, to pass over those that are whole.
  pure logical function may_have_broken(family, k)
    class(family_type), intent(in) :: family  !! the family; this version knows no bits
    integer, intent(in) :: k                  !! slot
    may_have_broken = k <= family%n_slots
  end function may_have_broken

  !> Whether bonds of slots of different groups of `lanes` may share a byte, so that one thread must
  !> break all of them.
  pure logical function bytes_are_shared(family)
    class(family_type), intent(in) :: family  !! the family
    bytes_are_shared = family%n_slots < 0
  end function bytes_are_shared

  !> The level of the step that the bond of slots `k` and `j` takes, 0 without substeps.
  pure integer function level_of_bond(family, k, j)
    class(family_type), intent(in) :: family  !! the family; this version knows of no substeps
    integer, intent(in) :: k                  !! slot of one end
    integer, intent(in) :: j                  !! slot of the other end
    level_of_bond = min(0, k, j, family%n_slots)
  end function level_of_bond

  !> Whether slot `k` may have bonds of a level of substeps.
  pure logical function has_level(family, k, level)
    class(family_type), intent(in) :: family  !! the family; this version knows of no substeps
    integer, intent(in) :: k                  !! slot
    integer, intent(in) :: level              !! 0 or above
    has_level = level == 0 .and. k <= family%n_slots
  end function has_level

  !> Room for the bonds of any one point.
  pure subroutine allocate_bonds(family, bonds)
    class(family_type), intent(in) :: family  !! whose largest number of bonds counts
    type(bonds_type), intent(out) :: bonds    !! (most_bonds) without a bond
    allocate (bonds%j(family%most_bonds), bonds%xi(family%most_bonds, family%dim), &
      & bonds%length(family%most_bonds), bonds%weight(family%most_bonds), &
      & bonds%intact(family%most_bonds))
  end subroutine allocate_bonds

end module pd_family_family
